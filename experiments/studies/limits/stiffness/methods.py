"""Five methods for the optimum, each a function of a problem and of what it calls with its weights.

Every method starts at zero weights and asks ``evaluate`` for the loss and its gradient. It ends
where it can go no further; ``evaluate`` ends it earlier by an exception.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import torch
from scipy.optimize import minimize

from experiments.studies.limits.stiffness import newton as of_newton
from experiments.studies.limits.stiffness.problem import Array, Evaluate, Problem

Method = Callable[[Problem, Evaluate], None]


def gradient_descent(problem: Problem, evaluate: Evaluate) -> None:
    """Steps of 1/B, with B the bound of the Hessian: stable everywhere."""
    rate = 1 / problem.bound
    _by_torch(problem, evaluate, partial(torch.optim.SGD, lr=rate))


def momentum(problem: Problem, evaluate: Evaluate) -> None:
    """Nesterov's momentum with the rate 1/B and the factor (√B − √λ)/(√B + √λ) (Nesterov, 2004,
    2.2.22)."""
    fast, slow = math.sqrt(problem.bound), math.sqrt(problem.strength)
    make = partial(
        torch.optim.SGD,
        lr=1 / problem.bound,
        momentum=(fast - slow) / (fast + slow),
        nesterov=True,
    )
    _by_torch(problem, evaluate, make)


def adam(problem: Problem, evaluate: Evaluate, rate: float) -> None:
    """Adam in full batches, at a constant rate."""
    _by_torch(problem, evaluate, partial(torch.optim.Adam, lr=rate))


def l_bfgs(problem: Problem, evaluate: Evaluate) -> None:
    """SciPy's L-BFGS, without limits of its own."""

    def flat(weights: Array) -> tuple[Any, Array]:
        loss, gradient = evaluate(weights.reshape(problem.start.shape))
        return loss, gradient.ravel()

    without: dict[str, Any] = {"ftol": 0.0, "gtol": 0.0}
    without |= {"maxiter": 10**9, "maxfun": 10**9}
    start = problem.start.ravel()
    minimize(flat, start, method="L-BFGS-B", jac=True, options=without)


def newton(problem: Problem, evaluate: Evaluate) -> None:
    """Newton's method, a Cholesky decomposition a step,
    with halved steps."""
    for _ in of_newton.newton(problem, problem.start, evaluate):
        pass


def _by_torch(
    problem: Problem,
    evaluate: Evaluate,
    make: Callable[..., torch.optim.Optimizer],
) -> None:
    """Steps of an optimiser without end; its weights share the memory of an array."""
    weights = problem.start
    parameter = torch.from_numpy(weights).requires_grad_()
    optimizer = make([parameter])
    while True:
        _, gradient = evaluate(weights)
        parameter.grad = torch.from_numpy(gradient)
        optimizer.step()
