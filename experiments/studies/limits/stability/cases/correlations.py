"""Mean correlations over pairs (Eqs. 4 and 5 of the paper); the reference is exact integer sums."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.studies.correlation.pairs import mean_pair_correlations
from experiments.studies.limits.numerics.measure import exact_mean
from experiments.studies.limits.stability.case import case

D = 250_000


def correlation_case(
    extreme: str,
    naive: str,
    tolerance: float = 1e-10,
) -> Any:
    ours = "mean_pair_correlations"
    return case(
        "correlations", extreme, naive, ours, "correlation", tolerance=tolerance
    )


def one_pass(x: NDArray[Any], y: NDArray[Any]) -> float:
    """The textbook's (⟨xy⟩ − ⟨x⟩⟨y⟩)/√(…), in the type of the samples."""
    covariance = (x * y).mean() - x.mean() * y.mean()
    variances = ((x * x).mean() - x.mean() ** 2) * ((y * y).mean() - y.mean() ** 2)
    return float(covariance / np.sqrt(variances))


def correlated(levels: int) -> NDArray[np.int64]:
    """Two frames of integers 0 … levels − 1 that share half of their pixels: [2, D]."""
    frames = np.random.default_rng(0).integers(0, levels, (2, D))
    frames[1, ::2] = frames[0, ::2]
    return frames


def compared(
    naive: Callable[..., float],
    frames: NDArray[np.int64],
    given: Any,
    ours: Any = None,
) -> tuple[Any, ...]:
    """A computation for `given`, the frames in its type, beside ours for the frames in ours."""
    samples = given if ours is None else ours
    mean = partial(mean_pair_correlations, samples, samples)
    return partial(naive, *given), mean, exact_mean(frames)


@correlation_case(
    "16-bit frames, mean 10^6 times the deviation: 65,000² has 10 digits, float32 seven",
    "⟨xy⟩ − ⟨x⟩⟨y⟩ in float32",
)
def mean_far_above_the_deviation() -> Any:
    frames = 65_000 + (correlated(236) == 0)  # one pixel in 236 is brighter by one
    return compared(
        one_pass, frames, frames.astype(np.float32), frames.astype(np.uint16)
    )


@correlation_case(
    "mean 10^9, deviation 577: float64 loses 12 of its 16 digits",
    "⟨xy⟩ − ⟨x⟩⟨y⟩ in float64",
)
def mean_far_above_the_deviation_in_float64() -> Any:
    frames = 10**9 + correlated(2000)
    return compared(one_pass, frames, frames.astype(np.float64))


@correlation_case(
    "16-bit frames up to 65,535: products in uint16 wrap",
    "⟨xy⟩ − ⟨x⟩⟨y⟩ of the camera's integers",
)
def sixteen_bit_frames() -> Any:
    frames = correlated(65_536)
    return compared(one_pass, frames, frames.astype(np.uint16))


@correlation_case(
    "pixels of 10^-200: their squares are zero in float64, a variance of zero gives NaN",
    "numpy.corrcoef",
)
def squares_that_underflow() -> Any:
    frames = correlated(4096)  # scaled by a power of two: exact
    return compared(lambda x, y: np.corrcoef(x, y)[0, 1], frames, frames * 2.0**-664)


@correlation_case(
    "N_s = 2: one pair; the mean over a whole Gram matrix counts each frame with itself",
    "mean of numpy.corrcoef",
    1e-12,
)
def two_samples_a_class() -> Any:
    frames = correlated(256)
    return compared(
        lambda *both: np.corrcoef(both).mean(), frames, frames.astype(np.uint8)
    )
