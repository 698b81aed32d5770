"""Training on extreme data; the reference is the optimum in extended precision."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.limits.stability.case import Case, relative
from experiments.studies.limits.stiffness.newton import newton, optimum
from experiments.studies.limits.stiffness.problem import Problem


def steps_that_overshoot(c: float = 1e6) -> Any:
    pixels = [[0, 255], [2, 1], [0, 1], [1, 0], [255, 5], [0, 255], [20, 20]]
    labels = np.array([0, 1, 0, 0, 0, 0, 0])
    n = len(labels)
    x = np.column_stack([np.array(pixels) / 255, np.ones(n)])
    problem = Problem(x, np.eye(2)[labels], 1 / (c * n))

    def objective(weights: np.ndarray) -> float:
        return c * n * float(problem.evaluate(weights)[0])

    def naive() -> float:
        start = problem.start
        *_, last = newton(problem, start, problem.evaluate, lengths=np.ones(1))
        return objective(last)

    def ours() -> float:
        frames = torch.tensor(pixels, dtype=torch.uint8)[:, None]
        return DualSoftmaxRegression(C=c, tol=1e-14).fit(frames, labels).objective_

    return naive, ours, objective(optimum(problem)), 1e-6


CASES = [
    Case("training", "steps that overshoot",
         "nearly separable frames, C = 10^6: full steps of Newton overshoot",
         "Newton's method, full steps", "DualSoftmaxRegression", "relative",
         relative, steps_that_overshoot),
]  # fmt: skip
