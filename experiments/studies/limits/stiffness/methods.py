"""Methods for the optimum, each a function of a problem and of what it tells where it is.

Every method starts at zero weights. It asks the watch for the loss and its gradient, or says which
loss it has reached; the watch ends it by an exception, unless it can go no further before.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from baselines.training import OPTIMIZERS
from experiments.studies.limits.stiffness import newton as of_newton
from experiments.studies.limits.stiffness.problem import Array, Problem


class Watching(Protocol):
    """Ends a method by an exception."""

    def evaluate(self, weights: Array) -> tuple[Any, Array]:
        """The loss and its gradient."""

    def reached(self, loss: float) -> None:
        """A method that computes its own loss says it."""


Method = Callable[[Problem, Watching], None]


def gradient_descent(problem: Problem, watch: Watching) -> None:
    """Steps of 1/B, with B the bound of the Hessian: stable everywhere."""
    rate = 1 / problem.bound
    _by_torch(problem, watch, partial(torch.optim.SGD, lr=rate))


def momentum(problem: Problem, watch: Watching) -> None:
    """Nesterov's momentum with the rate 1/B and the factor (√B − √λ)/(√B + √λ) (Nesterov, 2004,
    2.2.22)."""
    fast, slow = math.sqrt(problem.bound), math.sqrt(problem.strength)
    make = partial(
        torch.optim.SGD,
        lr=1 / problem.bound,
        momentum=(fast - slow) / (fast + slow),
        nesterov=True,
    )
    _by_torch(problem, watch, make)


def adam(problem: Problem, watch: Watching, rate: float, steps: int) -> None:
    """Adam in full batches, at a rate that falls to zero by a cosine in so many steps."""

    def falling(step: int) -> float:
        return (1 + math.cos(math.pi * step / steps)) / 2

    _by_torch(problem, watch, partial(torch.optim.Adam, lr=rate), falling, steps)


def l_bfgs(problem: Problem, watch: Watching) -> None:
    """SciPy's L-BFGS, without limits of its own."""

    def flat(weights: Array) -> tuple[Any, Array]:
        loss, gradient = watch.evaluate(weights.reshape(problem.start.shape))
        return loss, gradient.ravel()

    without: dict[str, Any] = {"ftol": 0.0, "gtol": 0.0}
    without |= {"maxiter": 10**9, "maxfun": 10**9}
    start = problem.start.ravel()
    minimize(flat, start, method="L-BFGS-B", jac=True, options=without)


def newton(problem: Problem, watch: Watching) -> None:
    """Newton's method, a Cholesky decomposition a step, with halved steps."""
    for _ in of_newton.newton(problem, problem.start, watch.evaluate):
        pass


def dual(problem: Problem, watch: Watching) -> None:
    """:class:`baselines.softmax_dual.DualSoftmaxRegression`, from the products of the frames."""
    n, n_classes = problem.onehot.shape
    c = 1 / (problem.strength * n)

    class Watched(DualSoftmaxRegression):
        def _objective(self, *given: Any) -> float:
            objective = super()._objective(*given)
            watch.reached(objective / (c * n))
            return objective

    model = Watched(C=c, tol=0.0, max_iter=10**9)
    model.classes_ = np.arange(n_classes)
    frames = torch.from_numpy(problem.x[:, :-1])
    model.solve(frames @ frames.T, torch.from_numpy(problem.onehot.argmax(1)))


def minibatches(problem: Problem, watch: Watching, **recipe: Any) -> None:
    """:class:`baselines.softmax.SoftmaxRegression` in float32, from zero weights."""
    n, n_classes = problem.onehot.shape

    class Centred(SoftmaxRegression):
        """Takes frames that are no whole numbers."""

        def scores(self, batch: Tensor) -> Tensor:
            found: Tensor = self.network_(batch)
            return found

        def read(self, frames: Any, index: Any) -> Tensor:
            part: Tensor = frames[index]
            return part

    c = 1 / (problem.strength * n)
    model = Centred(C=c, init="zeros", max_epochs=10**9, **recipe)
    frames = torch.from_numpy(problem.x[:, :-1]).float()
    model.shape_, model.classes_ = (1, frames.shape[1]), np.arange(n_classes)
    model.network_ = model._initial_network()
    weight, bias = model.network_.parameters()
    optimizer = OPTIMIZERS[model.optimizer]([weight, bias], lr=model.lr)
    targets = torch.from_numpy(problem.onehot.argmax(1))
    for _ in model._epochs(frames, targets, optimizer):
        both = torch.cat([weight, bias[:, None]], 1).detach().double()
        loss, _ = problem.evaluate(both.numpy())
        watch.reached(loss)


def _by_torch(
    problem: Problem,
    watch: Watching,
    make: Callable[..., torch.optim.Optimizer],
    factor: Callable[[int], float] = lambda step: 1.0,
    steps: float = math.inf,
) -> None:
    """Steps of an optimiser whose rate has a factor; its weights share the memory of an array."""
    weights = problem.start
    parameter = torch.from_numpy(weights).requires_grad_()
    optimizer = make([parameter])
    rate = optimizer.param_groups[0]["lr"]
    step = 0
    while step < steps:
        _, gradient = watch.evaluate(weights)
        parameter.grad = torch.from_numpy(gradient)
        optimizer.param_groups[0]["lr"] = rate * factor(step)
        optimizer.step()
        step += 1
