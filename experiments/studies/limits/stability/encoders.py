"""Encoders where bits are easily wrong; references are their definitions in whole numbers.

A hypervector by T quantiles q has T bits per pixel. For each of them exactly k = ⌊(1 − q)·D⌋ pixels
are ones: those above the k-th largest value, and none below it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import torch
from scipy import ndimage

from experiments.studies.limits.stability.case import Case, differing
from hdc import bits
from hdc.encoders import (
    Deviation,
    Encoder,
    Levels,
    Median,
    Quantile,
    Reference,
    ReferenceLevels,
    Smoothed,
)

Array = np.ndarray[Any, Any]
D = 4097  # pixels: enough for the search of thresholds, and no multiple of 64
LARGE = 2**24 + 1  # the first whole number that float32 cannot represent
HALF = [Fraction(1, 2)]
EIGHTHS = [Fraction(t, 8) for t in range(1, 8)]
DEVIATIONS = Deviation().thresholds
# Grey levels: seven weights of each of two axes are rounded to whole numbers of 2⁻¹².
SLACK = 7 * 2 * 2.0**-13 * 255


def random() -> np.random.Generator:
    return np.random.default_rng(0)


def greys(*shape: int) -> Array:
    return random().integers(0, 256, shape, dtype=np.uint8)


def rising(d: int) -> Array:
    return np.arange(d, dtype=np.int32)[None]


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
    "one bright pixel of 4,097": (
        "all pixels but one are equal: the median is the minimum",
        lambda: np.eye(1, D, D - 1, np.uint8)),
    "huge and tiny pixels of 4,097": (
        "float64 of 10^-300 and 10^300: their ratio overflows",
        lambda: np.where(random().random((1, D)) < 0.4, 1e300, 1e-300)),
    **{f"a rising frame of {d:,}": (
        "an odd number of pixels: one half has one more",
        partial(rising, d)) for d in (1, 65, D, LARGE)},
    "one pixel": ("a deviation of zero: 0/0", lambda: greys(2, 1)),
    "equal frames": ("a deviation of zero: 0/0", lambda: greys(1, 65).repeat(2, 0)),
    "65 pixels": ("in steps of 2^-16, squares wrap at 2^31", lambda: greys(2, 65)),
    "16,777,217 pixels": ("sums of squares near 2^59", lambda: greys(2, LARGE)),
    "pixels on a threshold": (  # their differences from the mean are −σ and σ
        "a pixel on a threshold is not above it",
        lambda: np.array([[0, 4, 4, 0], [4, 0, 0, 4]], np.uint8)),
    "image of 5 × 13 pixels": (
        "beyond its edges an image is black, or its middle pixel counts twice",
        lambda: greys(1, 5, 13)),
}  # fmt: skip


def encoded(encoder: Encoder, train: Array, planes: int) -> Array:
    """Bits [T, D] of the first of some frames [N, …] by an encoder that has learned them."""
    frames = torch.from_numpy(train)
    words = encoder.fit(frames).encode(frames[:1])
    n_pixels = frames[0].numel()
    return bits.unpack(words, planes * n_pixels).numpy().reshape(planes, -1)


def violations(
    ones: Array, values: Array, quantiles: Sequence[Any], slack: float
) -> int:
    """Bits [T, D] that break the definition; values [D] that are known to within a slack."""
    wrong = 0
    rising = np.sort(values)
    for of_quantile, q in zip(np.asarray(ones, bool), quantiles, strict=True):
        k = int((1 - q) * len(values))
        least = rising[len(values) - k] if k else np.inf
        wrong += abs(int(of_quantile.sum()) - k)
        wrong += int((~of_quantile & (values > least + slack)).sum())
        wrong += int((of_quantile & (values < least - slack)).sum())
    return wrong


# Values by which an encoder ranks pixels: exact ones, and the naive ones --------------------------


def grey_values(frames: Array) -> Array:
    return frames[0]


def smoothed(frames: Array, mode: str) -> Array:
    """An image smoothed by a Gaussian of one pixel."""
    image = frames[0].astype(float)
    return ndimage.gaussian_filter(image, sigma=1, truncate=3, mode=mode).ravel()


def steps(frame: Array) -> Array:
    """(x − mean)/deviation of grey values [D] in steps of 2⁻¹⁶, rounded down: int64 [D]."""
    n, grey = frame.size, frame.astype(np.int64)
    total, squares = int(grey.sum()), int((grey**2).sum())
    divisor = max(1, math.isqrt(n * squares - total**2))
    return (n * grey - total) * 2**16 // divisor  # below 2⁴⁹


def referred(frames: Array) -> Array:
    """Steps of the first frame minus the mean of all."""
    return steps(frames[0]) - sum(map(steps, frames)) // 2


def referred_in_floats(frames: Array) -> Array:
    apart = frames - frames.mean(1, keepdims=True)
    apart /= apart.std(1, keepdims=True)
    return (2**16 * (apart[0] - apart.mean(0))).astype(np.int32)


def above(differences: Array, thresholds: Sequence[float]) -> Array:
    """Whether a frame minus the reference [D] exceeds each threshold, in its deviations."""
    n, total = differences.size, int(differences.sum())
    squares = int((differences**2).sum())  # below 2⁶³
    sigma = math.isqrt((n * squares - total**2) // n**2)
    limits = [math.floor(Fraction(t) * sigma) for t in thresholds]
    return differences > np.array(limits)[:, None]


def prepared(encoder: Encoder, levels: Sequence[Any], ways: Any, name: str) -> Any:
    """Bits of an input; levels are quantiles, or thresholds in deviations."""
    frames = INPUTS[name][1]()
    exact, simple = ways
    by_rank = not isinstance(encoder, Deviation)

    def naive() -> Array:
        values = simple(frames)
        if by_rank:
            return values >= np.quantile(values, np.array(levels, float))[:, None]
        root = np.sqrt((values * values).mean())
        return values / root > np.array(levels)[:, None]

    values = exact(frames)
    ours = partial(encoded, encoder, frames, len(levels))
    return naive, ours, values if by_rank else above(values, levels)


RANKS = "bits by rank", "pixel ≥ numpy.quantile", (grey_values, grey_values)
REFERRED = "bits from a reference", "squares in int32", (referred, referred_in_floats)
SMOOTHED = (
    *("bits by rank", "black around the image, ≥ median"),
    [partial(smoothed, mode=mode) for mode in ("mirror", "constant")],
)
ROWS: list[tuple[Any, Encoder, Sequence[Any], list[str]]] = [
    (RANKS, Median(), HALF, [name for name in INPUTS if " of 4,097" in name]),
    (RANKS, Median(), HALF, ["a rising frame of 1", "a rising frame of 16,777,217"]),
    (RANKS, Quantile(), [Fraction(3, 4)], ["a rising frame of 65"]),
    (RANKS, Levels(), EIGHTHS, ["a rising frame of 65", "a saturated frame of 4,097"]),
    (SMOOTHED, Smoothed("median", 1), HALF, ["image of 5 × 13 pixels"]),
    (REFERRED, Reference(), HALF, ["one pixel", "65 pixels"]),
    (REFERRED, ReferenceLevels(), EIGHTHS, ["equal frames", "65 pixels"]),
    (REFERRED, Deviation(), DEVIATIONS, ["one pixel", "equal frames", "65 pixels"]),
    (REFERRED, Deviation([-1.0, 1.0]), [-1.0, 1.0], ["pixels on a threshold"]),
    (REFERRED, Deviation([0.5]), [0.5], ["16,777,217 pixels"]),
]


def case(way: Any, encoder: Encoder, levels: Sequence[Any], name: str) -> Case:
    part, naive, ways = way
    kind = type(encoder).__name__
    slack = SLACK if way is SMOOTHED else 0
    by_rank = partial(violations, quantiles=levels, slack=slack)
    return Case(
        part,
        f"{kind} {name}" if way is SMOOTHED else f"{kind}, {name}",
        INPUTS[name][0],
        naive,
        f"hdc.encoders.{kind}",
        "bits",
        differing if isinstance(encoder, Deviation) else by_rank,
        partial(prepared, encoder, levels, ways, name),
    )


CASES = [
    case(way, encoder, levels, name)
    for way, encoder, levels, names in ROWS
    for name in names
]
