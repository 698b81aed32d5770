"""Learning from little, extreme or degenerate data; references are closed forms and float64."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.correlation import CorrelationClassifier
from baselines.nearest_neighbour import NearestNeighbour
from baselines.ridge import RidgeReadout
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.stability.case import Trial, case
from hdc import HDCClassifier

training_case = partial(case, "training")

MODELS: tuple[Callable[[], Any], ...] = (
    HDCClassifier,
    SoftmaxRegression,
    DualSoftmaxRegression,
    RidgeReadout,
    CorrelationClassifier,
    NearestNeighbour,
)


def noise(*shape: int) -> Tensor:
    """Independent 8-bit pixels."""
    return torch.from_numpy(np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8))


# Softmax ------------------------------------------------------------------------------------------


@training_case(
    extreme="logits of ±10,160 and a wrong label: e^10160 is above any float",
    expected="six digits; probabilities before their logarithm are ∞/∞",
    reference="1.25·255²/16, by hand",
    unit="relative",
    naive="−log(exp(z) / Σ exp(z))",
    ours="SoftmaxRegression",
    tolerance=1e-6,
)
def logits_of_ten_thousand() -> Trial:
    # One step of rate 1.25 from W = 0 gives W_0 = −W_1 = 1.25·(x_0 − x_1)/8, logits ±1.25·255²/8,
    # and a loss of twice that for the third of four frames, whose label is wrong.
    x0, x1 = [0, 255], [255, 0]
    frames = torch.tensor([[x0], [x0], [x0], [x1]], dtype=torch.uint8)
    labels = np.array([0, 0, 1, 1])
    rate = 1.25
    exact = rate * 255**2 / 16

    def naive() -> float:
        x = frames.flatten(1).float()
        weights = torch.tensor([x0, x1]).sub(torch.tensor([x1, x0])) * (rate / 8)
        exponentials = (x @ weights.T).exp()
        likelihood = (exponentials / exponentials.sum(1, keepdim=True))[range(4), labels]
        return float(-likelihood.log().mean())

    def ours() -> float:
        model = SoftmaxRegression(
            pixels="raw", optimizer="SGD", lr=rate, batch_size=None, max_epochs=2, init="zeros"
        )
        return list(model.train(frames, labels))[1]["loss"]  # before the second step

    return Trial(naive=naive, ours=ours, error=lambda loss: abs(loss / exact - 1))


@training_case(
    extreme="two frames, each 50 times: a Gram matrix of rank one",
    expected="the optimum of the scalar problem; a Newton step in the samples' space is singular",
    reference="2βk with β = 2mC/(1 + e^(2βk)), by mpmath",
    unit="relative",
    naive="Newton's method, dense Hessian K·S·K + K",
    ours="DualSoftmaxRegression",
    tolerance=1e-6,
)
def duplicated_samples(m: int = 50, c: float = 1.0) -> Trial:
    frames = torch.tensor([[[255, 255, 0, 0]], [[0, 0, 255, 255]]], dtype=torch.uint8)
    frames, labels = frames.repeat(m, 1, 1), np.tile([0, 1], m)
    # Centred, the frames are ±d with k = d·d = 1. With W_0 = −W_1 = β·d the objective is
    # 2mC·log(1 + e^{−2βk}) + β²k.
    beta = mpmath.findroot(lambda b: b - 2 * m * c / (1 + mpmath.exp(2 * b)), 1.0)
    exact = float(2 * beta)

    def naive() -> float:
        x = frames.flatten(1).double() / 255
        x -= x.mean(0)
        gram, y = x @ x.T, torch.from_numpy(1.0 - labels)
        a = torch.zeros(2 * m, dtype=torch.float64)
        for _ in range(20):  # on the difference of the classes' weights, whose penalty is |v|²/4
            p = (gram @ a).sigmoid()
            hessian = gram @ torch.diag(2 * c * p * (1 - p)) @ gram + gram
            a -= torch.linalg.solve(hessian, gram @ (2 * c * (p - y) + a))
        return float((gram @ a)[0])

    def ours() -> float:
        model = DualSoftmaxRegression(C=c, tol=1e-14).fit(frames, labels)
        scores = model.scores(frames[:1])[0]
        return float(scores[0] - scores[1])

    return Trial(naive=naive, ours=ours, error=lambda margin: abs(margin / exact - 1))


@training_case(
    extreme="1000 small steps in bfloat16, which has 8 bits",
    expected="0.4 % of the loss (2^-8); weights kept in bfloat16 stand still below 2^-9 of them",
    reference="the same steps in float64",
    unit="relative",
    naive="the whole network in bfloat16",
    ours="SoftmaxRegression(dtype='bfloat16')",
    tolerance=2**-8,
    small={"steps": 200, "rate": 1e-2},
)
def steps_in_bfloat16(steps: int = 1000, rate: float = 2e-3) -> Trial:
    frames = torch.tensor([[[255, 255, 0, 0]], [[0, 0, 255, 255]]], dtype=torch.uint8)
    labels = np.array([0, 1])

    def descend(dtype: torch.dtype) -> float:
        x, targets = (frames.flatten(1) / 255).to(dtype), torch.from_numpy(labels)
        weights = torch.zeros(2, x.shape[1], dtype=dtype, requires_grad=True)
        optimizer = torch.optim.SGD([weights], rate)  # by symmetry the biases stay zero
        for _ in range(steps):
            optimizer.zero_grad()
            loss = F.cross_entropy(x @ weights.T, targets)
            loss.backward()
            optimizer.step()
        return float(loss.detach())

    def ours() -> float:
        model = SoftmaxRegression(
            optimizer="SGD",
            lr=rate,
            batch_size=None,
            max_epochs=steps,
            dtype="bfloat16",
            init="zeros",
        )
        return list(model.train(frames, labels))[-1]["loss"]

    exact = descend(torch.float64)
    return Trial(
        naive=lambda: descend(torch.bfloat16),
        ours=ours,
        error=lambda loss: abs(loss / exact - 1),
    )


# Classes ------------------------------------------------------------------------------------------


@training_case(
    extreme="samples of the classes 0 and 2 of three",
    expected="six models tell 0 from 2; the mean of no sample is NaN and the nearest to everything",
    reference="labels of the training frames",
    unit="wrong labels",
    naive="nearest of three class means",
    ours="every model of this project",
)
def a_class_without_training_samples(n: int = 10, side: int = 16) -> Trial:
    frames, labels = noise(n, side, side), np.arange(n) % 2 * 2

    def naive() -> list[np.ndarray]:
        x = frames.flatten(1).numpy().astype(float)
        means = np.array([x[labels == c].mean(0) for c in range(3)])
        return [((x[:, None] - means) ** 2).sum(2).argmin(1)]

    return Trial(
        naive=naive,
        ours=lambda: [make().fit(frames, labels).predict(frames) for make in MODELS],
        error=lambda found: max(int((predicted != labels).sum()) for predicted in found),
        remark=lambda: ", ".join(make.__name__ for make in MODELS),  # type: ignore[attr-defined]
    )
