"""Learning from extreme or degenerate data; references are closed forms and definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import expit
from torch import Tensor

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.limits.stability.case import Case, relative


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
    frames = torch.tensor(pixels, dtype=torch.uint8)[:, None]
    x = np.column_stack([np.array(pixels) / 255, np.ones(len(pixels))])
    signed = x * (1 - 2 * labels)[:, None]
    # ¼|v|² of the difference v of the classes' weights.
    penalty = np.diag([0.5, 0.5, 0.0])

    # F(v, b) = C Σ log(1 + e^{−z}) + ¼|v|²: scikit-learn's objective of two classes.
    def objective(w: np.ndarray) -> float:
        return c * np.logaddexp(0, -signed @ w).sum() + w @ penalty @ w / 2

    def gradient(w: np.ndarray) -> np.ndarray:
        return -c * signed.T @ expit(-signed @ w) + penalty @ w

    def hessian(w: np.ndarray) -> np.ndarray:
        p = expit(signed @ w)
        return c * (signed.T * p * (1 - p)) @ signed + penalty

    def naive() -> float:
        w = np.zeros(3)
        for _ in range(100):
            w -= np.linalg.solve(hessian(w), gradient(w))
        return objective(w)

    def ours() -> float:
        return DualSoftmaxRegression(C=c, tol=1e-14).fit(frames, labels).objective_

    options = {"gtol": 1e-3, "maxiter": 5000}
    by: Any = {"method": "trust-exact", "jac": gradient, "hess": hessian}
    exact = minimize(objective, np.zeros(3), options=options, **by)
    return naive, ours, exact.fun, 1e-6


CASES = [
    Case("training", "logits of ten thousand",
         "logits of ±10,160 and a wrong label: e^10160 is above any float, ∞/∞ is NaN",
         "−log(exp(z) / Σ exp(z))", "SoftmaxRegression", "relative",
         relative, logits_of_ten_thousand),
    Case("training", "steps that overshoot",
         "nearly separable frames, C = 10^6: full steps of Newton overshoot until exp(z) is ∞",
         "Newton's method, full steps", "DualSoftmaxRegression", "relative",
         relative, steps_that_overshoot),
]  # fmt: skip
