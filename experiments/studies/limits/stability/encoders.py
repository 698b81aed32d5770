"""Encoders where bits are easily wrong; references are their definitions in whole numbers.

A hypervector by T quantiles q has T bits per pixel. For each of them exactly k = ⌊(1 − q)·D⌋ pixels
are ones: those above the k-th largest value, and none below it. A hypervector by T thresholds has a
one where a frame minus a reference exceeds the threshold, in its deviations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import torch

from experiments.studies.limits.stability.case import Case, differing
from hdc import bits
from hdc.encoders import Deviation, Encoder, Levels, Median

Array = np.ndarray[Any, Any]
D = 4097  # pixels: enough for the search of thresholds, and no multiple of 64
LARGE = 2**24 + 1  # the first whole number that float32 cannot represent
HALF = [Fraction(1, 2)]
EIGHTHS = [Fraction(t, 8) for t in range(1, 8)]


def random() -> np.random.Generator:
    return np.random.default_rng(0)


def greys(*shape: int) -> Array:
    return random().integers(0, 256, shape, dtype=np.uint8)


# Name: why it is extreme, and frames [N, …].
INPUTS: dict[str, tuple[str, Callable[[], Array]]] = {
    "ties at the median of 4,097": (
        "8-bit speckle: one pixel in eighty equals the median",
        lambda: random().gamma(2, 25, (1, D)).round().clip(0, 255).astype(np.uint8)),
    "a constant frame of 4,097": (
        "every pixel is 128", lambda: np.full((1, D), 128, np.uint8)),
    "a saturated frame of 4,097": (
        "overexposed: more than 60 % of the pixels are 255",
        lambda: np.where(np.arange(D) < 6 * D // 10, np.uint8(255), greys(1, D))),
    "signed pixels of 4,097": (
        "int16 from -3 to 3, as after a dark frame was subtracted: a seventh equals the median",
        lambda: random().integers(-3, 4, (1, D), dtype=np.int16)),
    "signed zeros of 4,097": (
        "float32 zeros, half of them negative: equal, though their bits differ",
        lambda: np.array([[-0.0, 0.0]], np.float32)[:, np.arange(D) % 2]),
    "16-bit pixels of 4,097": (
        "uint16 over its whole range: torch has no median of that type",
        lambda: random().integers(0, 65_536, (1, D), dtype=np.uint16)),
    "64-bit pixels of 4,097": (
        "uint64 just below 2^64: as int64 negative, as float64 all equal",
        lambda: np.uint64(2**64 - 1) - random().integers(0, 9, (1, D), dtype=np.uint64)),
    "huge and tiny pixels of 4,097": (
        "float64 of 10^-300 and 10^300: their ratio overflows",
        lambda: np.where(random().random((1, D)) < 0.4, 1e300, 1e-300)),
    "one pixel": ("a deviation of zero: 0/0", lambda: greys(2, 1)),
    "equal frames": ("a deviation of zero: 0/0", lambda: greys(1, 65).repeat(2, 0)),
    "65 pixels": ("in steps of 2^-16, squares wrap at 2^31", lambda: greys(2, 65)),
    "16,777,217 pixels": ("sums of squares near 2^59", lambda: greys(2, LARGE)),
    "pixels on a threshold": (  # their differences from the mean are −σ and σ
        "a pixel on a threshold is not above it",
        lambda: np.array([[0, 4, 4, 0], [4, 0, 0, 4]], np.uint8)),
}  # fmt: skip


def encoded(encoder: Encoder, train: Array) -> Array:
    """Bits [T, D] of the first of some frames [N, D] by an encoder that has learned them."""
    frames = torch.from_numpy(train)
    words = encoder.fit(frames).encode(frames[:1])
    n_pixels = frames.shape[1]
    found = bits.unpack(words, encoder.dimension(n_pixels))
    return found.numpy().reshape(-1, n_pixels)


# By quantiles of the grey values ------------------------------------------------------------------


def by_rank(encoder: Encoder, quantiles: Sequence[Fraction], name: str) -> Case:
    """Bits of an input by quantiles; the exact result is the grey values."""
    extreme, make = INPUTS[name]

    def prepare() -> Any:
        frames = make()
        values = frames[0]

        def naive() -> Array:
            return values >= np.quantile(values, np.array(quantiles, float))[:, None]

        return naive, partial(encoded, encoder, frames), values

    kind = type(encoder).__name__
    return Case(
        "bits by rank",
        f"{kind}, {name}",
        extreme,
        "pixel ≥ numpy.quantile",
        f"hdc.encoders.{kind}",
        "bits",
        partial(violations, quantiles=quantiles),
        prepare,
    )


def violations(ones: Array, values: Array, quantiles: Sequence[Fraction]) -> int:
    """Bits [T, D] that break the definition for values [D]."""
    wrong = 0
    rising = np.sort(values)
    for of_quantile, q in zip(np.asarray(ones, bool), quantiles, strict=True):
        k = int((1 - q) * len(values))
        least = rising[len(values) - k]
        wrong += abs(int(of_quantile.sum()) - k)
        wrong += int((~of_quantile & (values > least)).sum())
        wrong += int((of_quantile & (values < least)).sum())
    return wrong


# By thresholds in deviations ----------------------------------------------------------------------


def by_deviation(encoder: Deviation, name: str) -> Case:
    """Bits of an input by the thresholds of the encoder."""
    extreme, make = INPUTS[name]
    thresholds = encoder.thresholds

    def prepare() -> Any:
        frames = make()

        def naive() -> Array:
            apart = frames - frames.mean(1, keepdims=True)
            apart /= apart.std(1, keepdims=True)
            values = (2**16 * (apart[0] - apart.mean(0))).astype(np.int32)
            root = np.sqrt((values * values).mean())
            return values / root > np.array(thresholds)[:, None]

        exact = above(steps(frames[0]) - sum(map(steps, frames)) // 2, thresholds)
        return naive, partial(encoded, encoder, frames), exact

    return Case(
        "bits from a reference",
        f"Deviation, {name}",
        extreme,
        "squares in int32",
        "hdc.encoders.Deviation",
        "bits",
        differing,
        prepare,
    )


def steps(frame: Array) -> Array:
    """(x − mean)/deviation of grey values [D] in steps of 2⁻¹⁶, rounded down: int64 [D]."""
    n, grey = frame.size, frame.astype(np.int64)
    total, squares = int(grey.sum()), int((grey**2).sum())
    divisor = max(1, math.isqrt(n * squares - total**2))
    return (n * grey - total) * 2**16 // divisor  # below 2⁴⁹


def above(differences: Array, thresholds: Sequence[float]) -> Array:
    """Whether a frame minus the reference [D] exceeds each threshold, in its deviations."""
    n, total = differences.size, int(differences.sum())
    squares = int((differences**2).sum())  # below 2⁶³
    sigma = math.isqrt((n * squares - total**2) // n**2)
    limits = [math.floor(Fraction(t) * sigma) for t in thresholds]
    return differences > np.array(limits)[:, None]


# Cases --------------------------------------------------------------------------------------------

CASES = [
    *(by_rank(Median(), HALF, name) for name in INPUTS if " of 4,097" in name),
    by_rank(Median(), HALF, "16,777,217 pixels"),
    by_rank(Levels(), EIGHTHS, "a saturated frame of 4,097"),
    *(
        by_deviation(Deviation(), name)
        for name in ("one pixel", "equal frames", "65 pixels")
    ),
    by_deviation(Deviation([-1.0, 1.0]), "pixels on a threshold"),
    by_deviation(Deviation([0.5]), "16,777,217 pixels"),
]
