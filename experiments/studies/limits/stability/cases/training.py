"""Learning from little, extreme or degenerate data; references are integers and closed forms."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import expit
from torch import Tensor

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.limits.stability.case import case, relative

training_case = partial(case, "training")


@training_case(
    "logits of ±10,160 and a wrong label: e^10160 is above any float, ∞/∞ is NaN",
    "−log(exp(z) / Σ exp(z))",
    "SoftmaxRegression",
    "relative",
    error=relative,
    tolerance=1e-6,
)
def logits_of_ten_thousand() -> Any:
    # One step of rate 1.25 from W = 0 gives W_0 = −W_1 = 1.25·(x_0 − x_1)/8, logits ±1.25·255²/8,
    # and a loss of twice that for the third of four frames, whose label is wrong.
    pixels = [[0, 255], [0, 255], [0, 255], [255, 0]]
    frames = torch.tensor(pixels, dtype=torch.uint8)[:, None]
    labels = np.array([0, 0, 1, 1])
    rate = 1.25
    weights = torch.tensor([[-255.0, 255.0], [255.0, -255.0]])
    weights *= rate / 8

    def naive() -> Tensor:
        logits = frames.flatten(1).float() @ weights.T
        exponentials = logits.exp()
        probabilities = exponentials / exponentials.sum(1, keepdim=True)
        likelihood = probabilities[range(4), labels]
        return -likelihood.log().mean()

    def ours() -> float:
        model = SoftmaxRegression(
            pixels="raw",
            optimizer="SGD",
            lr=rate,
            batch_size=None,
            max_epochs=2,
            init="zeros",
        )
        return list(model.train(frames, labels))[1]["loss"]  # before the second step

    return naive, ours, rate * 255**2 / 16


@training_case(
    "nearly separable frames, C = 10^6: full steps of Newton's method overshoot until exp(z) is ∞",
    "Newton's method, full steps",
    "DualSoftmaxRegression",
    "relative",
    error=relative,
    tolerance=1e-6,
)
def steps_that_overshoot(c: float = 1e6) -> Any:
    pixels = [[0, 255], [2, 1], [0, 1], [1, 0], [255, 5], [0, 255], [20, 20]]
    labels = np.array([0, 1, 0, 0, 0, 0, 0])
    frames = torch.tensor(pixels, dtype=torch.uint8)[:, None]
    scaled = np.array(pixels) / 255
    x = np.column_stack([scaled, np.ones(len(pixels))])
    signs = 1 - 2 * labels
    signed = x * signs[:, None]
    # ¼|v|² of the difference v of the classes' weights.
    penalty = np.diag([0.5, 0.5, 0.0])

    # F(v, b) = C Σ log(1 + e^{−z}) + ¼|v|²: scikit-learn's objective of two classes.
    def objective(w: np.ndarray) -> float:
        losses = np.logaddexp(0, -signed @ w)
        return c * losses.sum() + w @ penalty @ w / 2

    def gradient(w: np.ndarray) -> np.ndarray:
        missing = expit(-signed @ w)
        return -c * signed.T @ missing + penalty @ w

    def hessian(w: np.ndarray) -> np.ndarray:
        p = expit(signed @ w)
        return c * (signed.T * p * (1 - p)) @ signed + penalty

    def naive() -> float:
        w = np.zeros(3)
        for _ in range(100):
            w -= np.linalg.solve(hessian(w), gradient(w))
        return objective(w)

    def ours() -> float:
        model = DualSoftmaxRegression(C=c, tol=1e-14)
        return model.fit(frames, labels).objective_

    exact = minimize(
        objective,
        np.zeros(3),
        method="trust-exact",
        jac=gradient,
        hess=hessian,
        options={"gtol": 1e-3, "maxiter": 5000},
    )
    return naive, ours, exact.fun
