"""Learning from extreme or degenerate data; references are closed forms and definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.limits.stability.case import Case, relative
from experiments.studies.limits.stiffness.newton import newton, optimum
from experiments.studies.limits.stiffness.problem import Problem


def logits_of_ten_thousand() -> Any:
    # One step of rate 1.25 from W = 0 gives W_0 = −W_1 = 1.25·(x_0 − x_1)/8, logits ±1.25·255²/8,
    # and a loss of twice that for the third of four frames, whose label is wrong.
    pixels = [[0, 255], [0, 255], [0, 255], [255, 0]]
    frames = torch.tensor(pixels, dtype=torch.uint8)[:, None]
    labels = np.array([0, 0, 1, 1])
    rate = 1.25
    weights = torch.tensor([[-255.0, 255.0], [255.0, -255.0]]) * rate / 8

    def naive() -> Tensor:
        exponentials = (frames.flatten(1).float() @ weights.T).exp()
        probabilities = exponentials / exponentials.sum(1, keepdim=True)
        return -probabilities[range(4), labels].log().mean()

    def ours() -> float:
        recipe: Any = {"optimizer": "SGD", "batch_size": None, "init": "zeros"}
        model = SoftmaxRegression(pixels="raw", lr=rate, max_epochs=2, **recipe)
        return list(model.train(frames, labels))[1]["loss"]  # before the second step

    return naive, ours, rate * 255**2 / 16, 1e-6


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
    Case("training", "logits of ten thousand",
         "logits of ±10,160 and a wrong label: e^10160 is above any float, ∞/∞ is NaN",
         "−log(exp(z) / Σ exp(z))", "SoftmaxRegression", "relative",
         relative, logits_of_ten_thousand),
    Case("training", "steps that overshoot",
         "nearly separable frames, C = 10^6: full steps of Newton overshoot",
         "Newton's method, full steps", "DualSoftmaxRegression", "relative",
         relative, steps_that_overshoot),
]  # fmt: skip
