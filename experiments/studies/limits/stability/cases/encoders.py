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

from experiments.studies.limits.stability.case import case, differing
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
D = 250_000  # pixels of a frame in the paper
LARGE = 2**24 + 1  # the first whole number that float32 has not
HALF = [Fraction(1, 2)]
EIGHTHS = [Fraction(t, 8) for t in range(1, 8)]
UPPER = [Fraction(3, 4)]


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def encoded(encoder: Encoder, train: Array, frame: Array, planes: int) -> Array:
    """Bits [T, D] of a frame [H, W], or [D], by an encoder that has learnt others [N, …]."""
    words = encoder.fit(torch.from_numpy(train)).encode(torch.from_numpy(frame)[None])
    return bits.unpack(words, planes * frame.size).numpy().reshape(planes, -1)


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


FRAMES: tuple[tuple[str, str, Callable[[int], Array], str], ...] = (
    ("ties at the median", "8-bit speckle: some 3,000 of 250,000 pixels equal the median",
     lambda d: random().gamma(2, 25, d).round().clip(0, 255), "uint8"),  # two polarisations
    ("a constant frame", "every pixel is 128", lambda d: np.full(d, 128), "uint8"),
    ("a saturated frame", "overexposed: more than 60 % of the pixels are 255",
     lambda d: np.where(np.arange(d) < 6 * d // 10, 255, random().gamma(2, 255, d).clip(0, 255)),
     "uint8"),
    ("a dark frame", "underexposed: 70 % of the pixels are 0",
     lambda d: (random().random(d) < 0.3) * random(1).integers(1, 9, d), "uint8"),
    ("signed pixels",
     "int16 from -3 to 3, as after a dark frame was subtracted: a seventh equals the median",
     lambda d: random().integers(-3, 4, d), "int16"),
    ("signed zeros", "float32 zeros, half of them negative: equal, though their bits differ",
     lambda d: np.where(np.arange(d) % 2, -0.0, 0.0), "float32"),
    ("16-bit pixels", "uint16 over its whole range: torch has no median of that type",
     lambda d: random().integers(0, 65_536, d), "uint16"),
    ("64-bit pixels", "uint64 just below 2^64: as int64 negative, as float64 all equal",
     lambda d: np.uint64(2**64 - 1) - random().integers(0, 100, d).astype(np.uint64), "uint64"),
    ("one bright pixel", "all pixels but one are equal: the median is the minimum",
     lambda d: np.arange(d) == d - 1, "uint8"),
    ("huge and tiny pixels", "float64 of 10^-300 and 10^300: their ratio overflows",
     lambda d: np.where(random().random(d) < 0.4, 1e300, 1e-300), "float64"),
)  # fmt: skip


def in_one_order(ones: Array, pixels: Array) -> int:
    """Bits [2, D] of a frame [D] and of a constant one that break the definition.

    Ties go by one order of the pixels, the same for all frames. So of the pixels that tie in both,
    the ones of either frame contain those of the other.
    """
    wrong = violations(ones[:1], pixels, HALF)
    wrong += violations(ones[1:], np.zeros(len(pixels)), HALF)
    tied = pixels == np.sort(pixels)[len(pixels) - len(pixels) // 2]
    only_here, only_there = (int((tied & a & ~b).sum()) for a, b in (ones, ones[::-1]))
    return wrong + min(only_here, only_there)


def definition(make: Callable[[int], Array], dtype: str) -> Any:
    """A frame and a constant one: their bits by comparison with the median, and by the encoder."""
    frame = torch.from_numpy(make(D).astype(dtype))
    both = torch.stack([frame, frame[:1].expand(D)])

    def naive() -> Array:
        return torch.stack([row > row.median() for row in both]).numpy()

    def ours() -> Array:
        return bits.unpack(Median().encode(both), D).numpy().astype(bool)

    return naive, ours, frame.numpy()


for _name, _extreme, _pixels, _dtype in FRAMES:
    case(
        "bits of a frame", _extreme, "pixel > median", "hdc.encoders.Median", "bits",
        name=_name, error=in_one_order,
    )(partial(definition, _pixels, _dtype))  # fmt: skip


def ranked(make: type[Encoder], quantiles: Sequence[Fraction], d: int) -> Any:
    """A rising frame of D pixels."""
    frame = np.arange(d, dtype=np.int32)

    def naive() -> Array:
        shares = torch.tensor([float(q) for q in quantiles])
        limits = torch.quantile(torch.from_numpy(frame).float(), shares)
        return frame >= limits.numpy()[:, None]

    ours = partial(encoded, make(), frame[None], frame, len(quantiles))
    return naive, ours, frame


for _make, _quantiles in ((Median, HALF), (Quantile, UPPER), (Levels, EIGHTHS)):
    for _d in (1, 65, LARGE) if _make is Median else (1, 65):
        case(
            "encoders", f"D = {_d:,} is odd: which of two parts has the pixel between",
            "pixel ≥ torch.quantile", f"hdc.encoders.{_make.__name__}", "bits",
            name=f"{_make.__name__.lower()} of {_d:,} pixels",
            error=partial(violations, quantiles=_quantiles),
        )(partial(ranked, _make, _quantiles, _d))  # fmt: skip


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


def relative(encoder: Encoder, levels: Sequence[Any], d: int, equal: bool) -> Any:
    """A frame minus the mean of two training frames, of which it is one, or both.

    Of levels by rank the quantiles, of others the thresholds in deviations.
    """
    train = random().integers(0, 256, (2, d), dtype=np.uint8)
    if equal:
        train[1] = train[0]
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

    ours = partial(encoded, encoder, train, train[0], len(levels))
    return naive, ours, exact


for _encoder, _levels in (
    (Reference(), HALF),
    (ReferenceLevels(), EIGHTHS),
    (Deviation(), Deviation().thresholds),
    (Deviation([0.5]), [0.5]),
):
    _kind = type(_encoder).__name__
    _large = len(_levels) == 1 and _kind == "Deviation"
    for _d, _equal in (
        [(LARGE, False)] if _large else [(1, False), (65, True), (65, False)]
    ):
        case(
            "encoders",
            "0/0 of one pixel or of equal frames; in steps of 2^-16, squares wrap at 2^31",
            "squares in int32", f"hdc.encoders.{_kind}", "bits",
            name=f"{_kind} of {_d:,} pixels{', equal frames' * _equal}",
            error=differing if _kind == "Deviation" else partial(violations, quantiles=_levels),
        )(partial(relative, _encoder, _levels, _d, _equal))  # fmt: skip


SLACK = 7 * 2 * 2.0**-13 * 255
"""Grey levels: seven weights of each of two axes are rounded to whole numbers of 2⁻¹²."""


def smoothed(shape: tuple[int, int]) -> Any:
    """An image smoothed by a Gaussian of one pixel that is mirrored at its edges."""
    image = random().integers(0, 256, shape, dtype=np.uint8)

    def of(mode: str) -> Array:
        gaussian = partial(ndimage.gaussian_filter, sigma=1, truncate=3, mode=mode)
        return gaussian(image.astype(float)).ravel()

    def naive() -> Array:
        values = of("constant")
        return (values >= np.median(values))[None]

    ours = partial(encoded, Smoothed("median", 1), image[None], image, 1)
    return naive, ours, of("mirror")


for _shape in ((1, 1), (5, 13)):
    case(
        "encoders", "beyond its edges an image is black, or its middle pixel counts twice",
        "black around the image, ≥ median", "hdc.encoders.Smoothed", "bits",
        name=f"Smoothed image of {_shape[0]} × {_shape[1]} pixels",
        error=partial(violations, quantiles=HALF, slack=SLACK),
    )(partial(smoothed, _shape))  # fmt: skip
