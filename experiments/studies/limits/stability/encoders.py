"""Encoders where bits are easily wrong; references are their definitions in whole numbers.

Of T quantiles q a hypervector has T bits a pixel: of each, exactly k = ⌊(1 − q)·D⌋ pixels are ones,
those above the k-th largest value, none of those below it.
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
D = 4097  # pixels: large enough to be searched, and no whole number of words
LARGE = 2**24 + 1  # the first whole number that float32 has not
HALF = [Fraction(1, 2)]
EIGHTHS = [Fraction(t, 8) for t in range(1, 8)]


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


INPUTS: dict[str, tuple[str, str, Callable[[int], Array]]] = {
    "ties at the median": (
        "8-bit speckle: one pixel in eighty equals the median",
        "uint8", lambda d: random().gamma(2, 25, d).round().clip(0, 255)),
    "a constant frame": ("every pixel is 128", "uint8", lambda d: np.full(d, 128)),
    "a saturated frame": (
        "overexposed: more than 60 % of the pixels are 255",
        "uint8", lambda d: np.where(np.arange(d) < 6 * d // 10, 255, random().integers(0, 256, d))),
    "signed pixels": (
        "int16 from -3 to 3, as after a dark frame was subtracted: a seventh equals the median",
        "int16", lambda d: random().integers(-3, 4, d)),
    "signed zeros": (
        "float32 zeros, half of them negative: equal, though their bits differ",
        "float32", lambda d: np.where(np.arange(d) % 2, -0.0, 0.0)),
    "16-bit pixels": (
        "uint16 over its whole range: torch has no median of that type",
        "uint16", lambda d: random().integers(0, 65_536, d)),
    "64-bit pixels": (
        "uint64 just below 2^64: as int64 negative, as float64 all equal",
        "uint64", lambda d: np.uint64(2**64 - 1) - random().integers(0, 9, d).astype(np.uint64)),
    "one bright pixel": (
        "all pixels but one are equal: the median is the minimum",
        "uint8", lambda d: np.arange(d) == d - 1),
    "huge and tiny pixels": (
        "float64 of 10^-300 and 10^300: their ratio overflows",
        "float64", lambda d: np.where(random().random(d) < 0.4, 1e300, 1e-300)),
    "a rising frame": (
        "which of two parts has the pixel between, of an odd number",
        "int32", lambda d: np.arange(d)),
}  # fmt: skip


def encoded(encoder: Encoder, train: Array, planes: int) -> Array:
    """Bits [T, D] of the first of some frames [N, …] by an encoder that has learnt them."""
    frames = torch.from_numpy(train)
    words = encoder.fit(frames).encode(frames[:1])
    n_pixels = frames[0].numel()
    return bits.unpack(words, planes * n_pixels).numpy().reshape(planes, -1)


def violations(
    ones: Array, values: Array, quantiles: Sequence[Any], slack: float = 0
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


def ranked(encoder: Encoder, quantiles: Sequence[Fraction], name: str, d: int) -> Any:
    """A frame of D pixels of one of :data:`INPUTS`."""
    _, kind, make = INPUTS[name]
    frame = make(d).astype(kind)

    def naive() -> Array:
        values = torch.from_numpy(frame).float()
        limits = torch.quantile(values, torch.tensor([float(q) for q in quantiles]))
        return (values >= limits[:, None]).numpy()

    return naive, partial(encoded, encoder, frame[None], len(quantiles)), frame


def steps(frame: Array) -> Array:
    """(x − mean)/deviation of grey values [D] in steps of 2⁻¹⁶, rounded down: int64 [D]."""
    n, greys = frame.size, range(256)
    counts = np.bincount(frame, minlength=256).tolist()
    total = sum(grey * count for grey, count in enumerate(counts))
    squares = sum(grey**2 * count for grey, count in enumerate(counts))
    divisor = max(1, math.isqrt(n * squares - total**2))
    return np.array([(n * grey - total) * 2**16 // divisor for grey in greys])[frame]


def above(differences: Array, thresholds: Sequence[float]) -> Array:
    """Whether a frame minus the reference [D] exceeds each threshold, in its deviations."""
    n, total = differences.size, int(differences.sum())
    squares = int((differences**2).sum())  # below 2⁶³
    sigma = math.isqrt((n * squares - total**2) // n**2)
    limits = [math.floor(Fraction(t) * sigma) for t in thresholds]
    return np.stack([differences > limit for limit in limits])


def referred(encoder: Encoder, levels: Sequence[Any], make: Callable[[], Array]) -> Any:
    """The first of training frames [2, D] minus their mean.

    Of levels by rank the quantiles, of others the thresholds in deviations.
    """
    train = make()
    exact = steps(train[0]) - sum(map(steps, train)) // 2
    by_rank = isinstance(encoder, Reference)
    if not by_rank:
        exact = above(exact, levels)

    def naive() -> Array:
        apart = train - train.mean(1, keepdims=True)
        apart /= train.std(1, keepdims=True)
        found = (2**16 * (apart[0] - apart.mean(0))).astype(np.int32)
        if by_rank:
            return found >= np.quantile(found, np.array(levels, float))[:, None]
        shares = found / np.sqrt((found * found).mean())
        return shares > np.array(levels)[:, None]

    return naive, partial(encoded, encoder, train, len(levels)), exact


def drawn(n: int, d: int) -> Array:
    return random().integers(0, 256, (n, d), dtype=np.uint8)


def on_a_threshold() -> Array:
    """Frames whose differences from their mean are −σ and σ."""
    return np.array([[0, 4, 4, 0], [4, 0, 0, 4]], np.uint8)


SLACK = 7 * 2 * 2.0**-13 * 255
"""Grey levels: seven weights of each of two axes are rounded to whole numbers of 2⁻¹²."""


def smoothed(shape: tuple[int, int] = (5, 13)) -> Any:
    """An image smoothed by a Gaussian of one pixel that is mirrored at its edges."""
    image = random().integers(0, 256, shape, dtype=np.uint8)

    def of(mode: str) -> Array:
        gaussian = partial(ndimage.gaussian_filter, sigma=1, truncate=3, mode=mode)
        return gaussian(image.astype(float)).ravel()

    def naive() -> Array:
        values = of("constant")
        return (values >= np.median(values))[None]

    return naive, partial(encoded, Smoothed("median", 1), image[None], 1), of("mirror")


CASES = [
    Case(
        "bits by rank", f"{type(encoder).__name__}, {name} of {d:,}", INPUTS[name][0],
        "pixel ≥ torch.quantile", f"hdc.encoders.{type(encoder).__name__}", "bits",
        partial(violations, quantiles=quantiles), partial(ranked, encoder, quantiles, name, d),
    )
    for encoder, quantiles, inputs in (
        (Median(), HALF, [(name, D) for name in INPUTS]),
        (Median(), HALF, [("a rising frame", 1), ("a rising frame", LARGE)]),
        (Quantile(), [Fraction(3, 4)], [("a rising frame", 65)]),
        (Levels(), EIGHTHS, [("a rising frame", 65), ("a saturated frame", D)]),
    )
    for name, d in inputs
]  # fmt: skip
_DEVIATIONS = Deviation().thresholds
CASES += [
    Case(
        "bits from a reference", f"{type(encoder).__name__}, {name}", extreme,
        "squares in int32", f"hdc.encoders.{type(encoder).__name__}", "bits",
        differing if type(encoder) is Deviation else partial(violations, quantiles=levels),
        partial(referred, encoder, levels, make),
    )
    for encoder, levels, inputs in (
        (Reference(), HALF, ("one pixel", "65 pixels")),
        (ReferenceLevels(), EIGHTHS, ("equal frames", "65 pixels")),
        (Deviation(), _DEVIATIONS, ("one pixel", "equal frames", "65 pixels")),
        (Deviation([-1.0, 1.0]), [-1.0, 1.0], ("pixels on a threshold",)),
        (Deviation([0.5]), [0.5], ("16,777,217 pixels",)),
    )
    for name, extreme, make in (
        ("one pixel", "0/0", lambda: drawn(2, 1)),
        ("equal frames", "0/0", lambda: drawn(1, 65).repeat(2, 0)),
        ("65 pixels", "in steps of 2^-16, squares wrap at 2^31", lambda: drawn(2, 65)),
        ("pixels on a threshold", "they are no ones", on_a_threshold),
        ("16,777,217 pixels", "sums of squares near 2^59", lambda: drawn(2, LARGE)),
    )
    if name in inputs
]  # fmt: skip
CASES.append(
    Case(
        "bits by rank", "Smoothed image of 5 × 13 pixels",
        "beyond its edges an image is black, or its middle pixel counts twice",
        "black around the image, ≥ median", "hdc.encoders.Smoothed", "bits",
        partial(violations, quantiles=HALF, slack=SLACK), smoothed,
    )
)  # fmt: skip
