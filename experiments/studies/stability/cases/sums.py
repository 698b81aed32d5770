"""Sums over many pixels or many samples; the reference is integers."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier
from baselines.dual import centred_gram
from baselines.integer import integer_product
from baselines.pixels import PixelScaling, fit_scaling
from baselines.softmax import SoftmaxRegression
from experiments.studies.stability.case import Trial, case

training_case = partial(case, "training")


@training_case(
    extreme="250,000 products of −128 and −128: a sum above 2^31",
    expected="the exact integer; an int32 sum wraps",
    reference="Python integers",
    unit="relative",
    naive="int32 matrix product",
    ours="baselines.integer.integer_product",
)
def integer_overflow(d: int = 250_000) -> Trial:
    x = torch.full((1, d), -128, dtype=torch.int8)
    return Trial(
        naive=lambda: int(x.int() @ x.int().T),
        ours=lambda: int(integer_product(x, x.T)),
        error=lambda product: abs(product / (128 * 128 * d) - 1),
    )


@training_case(
    extreme="frames of 200 and 201 only: what tells them apart is 10^-5 of the Gram matrix",
    expected="ten digits; float32 products lose five of seven before the mean is taken off",
    reference="Python integers",
    unit="relative",
    naive="float32 X·Xᵀ, then centred",
    ours="baselines.dual.centred_gram",
    tolerance=1e-10,
    small={"d": 10_000},
)
def gram_matrix_of_nearly_equal_frames(n: int = 6, d: int = 250_000) -> Trial:
    extra = np.random.default_rng(0).integers(0, 2, (n, d))
    centred = n * extra - extra.sum(0)  # n times the centred frames, in integers
    exact = torch.from_numpy((centred @ centred.T) / (n * n * 255.0**2))
    frames = torch.from_numpy((200 + extra).astype(np.uint8))

    def naive() -> Tensor:
        x = frames.float() / 255
        gram = x @ x.T
        return gram - gram.mean(0) - gram.mean(1, keepdim=True) + gram.mean()

    return Trial(
        naive=naive,
        ours=lambda: centred_gram(frames, PixelScaling(scale=1 / 255)),
        error=lambda gram: float((gram - exact).abs().max() / exact.abs().max()),
    )


@training_case(
    extreme="16-bit pixels: one always 65,535, one that is one less in one of 400 frames",
    expected="0 for the first, six digits for the second; (x − μ)/σ is 0/0 for the first",
    reference="integers and mpmath",
    unit="deviations",
    naive="(x − mean) / std in float32",
    ours="pixels: standard",
    tolerance=2e-5,
)
def standardised_pixels(n: int = 400) -> Trial:
    pixels = np.full((n, 1, 2), 65_535, np.uint16)
    pixels[0, 0, 1] -= 1
    frames, labels = torch.from_numpy(pixels), np.arange(n) % 2
    # The second pixel has mean 65,535 − 1/n and variance (n − 1)/n².
    high = 1 / math.sqrt(n - 1)
    exact = torch.zeros(n, 2)
    exact[:, 1] = high
    exact[0, 1] = -(n - 1) * high

    def naive() -> Tensor:
        x = frames.flatten(1).to(torch.float32)
        return (x - x.mean(0)) / x.std(0, correction=0)

    def ours() -> Tensor:
        model: Classifier = SoftmaxRegression()
        model.start(frames, labels)
        scaled = fit_scaling("standard", model, frames)(model.read(frames, slice(0, n)))
        return scaled.flatten(1)

    return Trial(naive=naive, ours=ours, error=lambda values: float((values - exact).abs().max()))
