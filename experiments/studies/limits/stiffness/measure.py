"""Softmax regression as a stiff problem: how five methods fare as the condition number rises.

The same frames become stiffer by a weaker penalty and by less contrast, which makes them nearly
collinear. Each method runs until it arrives, fails, or has used its time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np

from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.task import Context, Row, Task
from experiments.studies.limits.stiffness import methods
from experiments.studies.limits.stiffness.newton import optimum
from experiments.studies.limits.stiffness.problem import Array, Problem, condition
from scenes.frames import Scene

_LATER = 1.25  # factor between the times of two points of a curve


class Stiffness(Task, frozen=True):
    """One row: a point of the curve of a method on a problem.

    Columns: ``problem``, counted from 0; its ``contrast``, ``strength`` and ``kappa``; ``method``;
    ``evaluations`` of the gradient and ``fit_s`` until then; ``gradient``, its norm relative to the
    first; ``error``, loss minus that of the optimum; and in the last row of a method ``ended``, why
    it ended: ``arrived``, ``out of time``, or what failed. Arguments:
    configs/experiment/stiffness.yaml.
    """

    revision: ClassVar = 2
    timed: ClassVar = True

    scene: Mapping[str, Any]
    split: Split
    seed: int
    side: int
    problems: Sequence[Mapping[str, float | int]]
    adam_rates: Sequence[float | int]
    budget_s: float | int
    goal: float | int

    def rows(self, context: Context) -> Iterator[Row]:
        made = context.scene(self.scene, self.seed)
        train, _ = choose(made, self.split, self.seed)
        frames, onehot = pixels_of(made, train, self.side)
        every = named_methods(self.adam_rates)
        warm_up(Problem(frames / 255, onehot, 1.0), every)
        for number, how in enumerate(self.problems):
            x = of_contrast(frames, how["contrast"])
            problem = Problem(x, onehot, how["strength"])
            best = optimum(problem)
            least, _ = problem.evaluate(best)
            same = {"problem": number, **how, "origin": made.origin}
            same["kappa"] = condition(problem, best.astype(np.float64))
            for name, method in every.items():
                context.note(f"κ = {same['kappa']:.1e}, {name}")
                watch = Watch(problem, least, self.budget_s, self.goal)
                for point in watch.follow(method):
                    yield same | {"method": name, **point}


def pixels_of(scene: Scene, train: Array, side: int) -> tuple[Array, Array]:
    """Frames float64 [N, D] of side × side pixels, evenly spread, and their classes [N, L]."""
    frames = scene.frames(train)
    rows, columns = (
        np.linspace(0, length - 1, side).astype(int) for length in frames.shape[1:]
    )
    spread = frames[:, rows][:, :, columns]
    _, classes = np.unique(scene.labels[train], return_inverse=True)
    return spread.flatten(1).double().numpy(), np.eye(classes.max() + 1)[classes]


def of_contrast(frames: Array, contrast: float) -> Array:
    """Frames [N, D] whose deviations from the mean grey are this part of what they were, scaled to
    a mean square of their norms of one."""
    grey = frames.mean()
    flat = grey + contrast * (frames - grey)
    return flat / np.sqrt((flat**2).sum(1).mean())


def named_methods(adam_rates: Sequence[float]) -> dict[str, methods.Method]:
    """The methods by their names; Adam once per rate."""
    named: dict[str, methods.Method] = {
        "gradient descent": methods.gradient_descent,
        "momentum": methods.momentum,
    }
    for rate in adam_rates:
        named[f"Adam, rate {rate:g}"] = partial(methods.adam, rate=rate)
    return named | {"L-BFGS": methods.l_bfgs, "Newton": methods.newton}


def warm_up(problem: Problem, every: Mapping[str, methods.Method]) -> None:
    """A moment of each method, since the first steps of a library load parts of it."""
    for method in every.values():
        Watch(problem, 0.0, budget_s=0.0, goal=0.0).follow(method)


class Ended(Exception):
    """Ends a method; its text is why."""


@dataclass
class Watch:
    """Points that a method evaluates, and when: the clock stands still while a point is judged.

    Args:
        problem: what the method minimises.
        least: F of the optimum, of more digits than float64.
        budget_s: time that a method has.
        goal: norm of the gradient, relative to the first, at which it has arrived.
    """

    problem: Problem
    least: float
    budget_s: float
    goal: float
    points: list[Row] = field(default_factory=list)

    def follow(self, method: methods.Method) -> list[Row]:
        """The points of the curve of a method."""
        self.points, self._evaluations, self._judging = [], 0, 0.0
        self._first, self._due = 0.0, 0.0
        self._begin = time.perf_counter()
        try:
            method(self.problem, self._evaluate)
            ended = "failed: no step lowers the loss"
        except Ended as end:
            ended = str(end)
        except np.linalg.LinAlgError:
            ended = "failed: Hessian not positive definite"
        self._judge()
        self.points[-1]["ended"] = ended
        return self.points

    def _evaluate(self, weights: Array) -> tuple[Any, Array]:
        loss, gradient = self.problem.evaluate(weights)
        self._evaluations += 1
        norm = float(np.linalg.norm(gradient))
        self._first = self._first or norm
        self._share, self._weights = norm / self._first, weights
        self._seconds = time.perf_counter() - self._begin - self._judging
        if not np.isfinite(norm):
            raise Ended("failed: not a number")
        if self._share <= self.goal:
            raise Ended("arrived")
        if self._seconds >= self.budget_s:
            raise Ended("out of time")
        if self._seconds >= self._due:
            self._due = _LATER * self._seconds
            self._judge()
        return loss, gradient

    def _judge(self) -> None:
        """A point of the curve at the last evaluation."""
        begin = time.perf_counter()
        loss, _ = self.problem.evaluate(self._weights.astype(np.longdouble))
        self.points.append(
            {
                "evaluations": self._evaluations,
                "fit_s": self._seconds,
                "gradient": self._share,
                "error": float(loss - self.least),
                "ended": "",
            }
        )
        self._judging += time.perf_counter() - begin
