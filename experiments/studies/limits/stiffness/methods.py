"""Methods for the optimum, each a function of a problem and of what watches it.

Every method starts at zero weights. It asks the watch for the loss and its gradient, or says which
loss it has reached; the watch ends it by an exception, unless it can go no further before.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.records.rows import Row
from experiments.studies.limits.stiffness import newton as of_newton
from experiments.studies.limits.stiffness.problem import Array, Problem

_LATER = 1.25  # factor between the times of two points of a curve


class Ended(Exception):
    """Ends a method; its text is why."""


@dataclass
class Watch:
    """Records the points that a method reaches, and their times.

    Args:
        problem: what the method minimises.
        least: F of the optimum.
        budget_s: time that a method has.
        goal: error, in units of the first, at which it has arrived.
    """

    problem: Problem
    least: float
    budget_s: float
    goal: float
    points: list[Row] = field(default_factory=list)

    def follow(self, method: Method) -> list[Row]:
        """The points of the curve of a method; the first is that of zero weights."""
        self._evaluations, self._due = 0, 0.0
        first, _ = self.problem.evaluate(self.problem.start)
        self._unit = float(first) - self.least
        self._begin = time.perf_counter()
        try:
            method(self.problem, self)
            ended = "goes no further"
        except Ended as end:
            ended = str(end)
        except np.linalg.LinAlgError:
            ended = "failed: Hessian not positive definite"
        self.points.append(self._point | {"ended": ended})
        return self.points

    def evaluate(self, weights: Array) -> tuple[Any, Array]:
        """The loss and its gradient."""
        loss, gradient = self.problem.evaluate(weights)
        self.reached(float(loss))
        return loss, gradient

    def reached(self, loss: float) -> None:
        """Keep the point, if it is due.

        Raises:
            Ended: the method has arrived, failed, or used its time.
        """
        self._evaluations += 1
        seconds = time.perf_counter() - self._begin
        error = (loss - self.least) / self._unit
        self._point: Row = {"evaluations": self._evaluations, "fit_s": seconds}
        self._point |= {"error": error, "ended": ""}
        if not np.isfinite(error):
            raise Ended("failed: not a number")
        if error <= self.goal:
            raise Ended("arrived")
        if seconds >= self.budget_s:
            raise Ended("out of time")
        if seconds >= self._due:
            self._due = _LATER * seconds
            self.points.append(self._point)


Method = Callable[[Problem, Watch], None]


def gradient_descent(problem: Problem, watch: Watch, momentum: float = 0.0) -> None:
    """Steps of 1/B, with B the bound of the Hessian: stable everywhere."""
    rate = 1 / problem.bound
    weights, velocity = problem.start, problem.start
    while True:
        _, gradient = watch.evaluate(weights)
        velocity = momentum * velocity + gradient
        weights = weights - rate * (gradient + momentum * velocity)


def momentum(problem: Problem, watch: Watch) -> None:
    """Nesterov's momentum with the rate 1/B and the factor (√B − √λ)/(√B + √λ) (Nesterov, 2004,
    2.2.22)."""
    fast, slow = math.sqrt(problem.bound), math.sqrt(problem.strength)
    gradient_descent(problem, watch, (fast - slow) / (fast + slow))


def adam(problem: Problem, watch: Watch, rate: float, steps: int) -> None:
    """Adam in full batches, at a rate that falls to zero by a cosine in so many steps."""
    weights = torch.from_numpy(problem.start).requires_grad_()
    optimizer = torch.optim.Adam([weights], lr=rate)
    for step in range(steps):
        _, gradient = watch.evaluate(weights.detach().numpy())
        weights.grad = torch.from_numpy(gradient)
        falling = (1 + math.cos(math.pi * step / steps)) / 2
        optimizer.param_groups[0]["lr"] = rate * falling
        optimizer.step()


def l_bfgs(problem: Problem, watch: Watch) -> None:
    """SciPy's L-BFGS, without limits of its own."""

    def flat(weights: Array) -> tuple[Any, Array]:
        loss, gradient = watch.evaluate(weights.reshape(problem.start.shape))
        return loss, gradient.ravel()

    without: dict[str, Any] = {"ftol": 0.0, "gtol": 0.0}
    without |= {"maxiter": 10**9, "maxfun": 10**9}
    start = problem.start.ravel()
    minimize(flat, start, method="L-BFGS-B", jac=True, options=without)


def newton(problem: Problem, watch: Watch) -> None:
    """Newton's method, a Cholesky decomposition a step, with halved steps."""
    for _ in of_newton.newton(problem, problem.start, watch.evaluate):
        pass


def dual(problem: Problem, watch: Watch) -> None:
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


def minibatches(problem: Problem, watch: Watch, **recipe: Any) -> None:
    """:class:`baselines.softmax.SoftmaxRegression` in float32, from zero weights."""
    n, d = len(problem.x), problem.x.shape[1] - 1
    floats = torch.from_numpy(problem.x[:, None, :-1]).float()

    class Centred(SoftmaxRegression):
        """Reads centred frames in place of whole numbers."""

        def read(self, frames: Any, index: Any) -> Tensor:
            part: Tensor = floats[index]
            return part

    c = 1 / (problem.strength * n)
    model = Centred(pixels="raw", C=c, init="zeros", max_epochs=10**9, **recipe)
    stand_in = torch.zeros(n, 1, d, dtype=torch.uint8)
    for _ in model.train(stand_in, problem.onehot.argmax(1)):
        weight, bias = model.network_.parameters()
        both = torch.cat([weight, bias[:, None]], 1).detach().double()
        loss, _ = problem.evaluate(both.numpy())
        watch.reached(loss)
