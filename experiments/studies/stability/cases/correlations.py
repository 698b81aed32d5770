"""Mean correlations over pairs (Eqs. 4 and 5 of the paper); the reference is exact integer sums."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from experiments.studies.correlation.sums import (
    mean_pair_correlations,
    pair_correlations_double_sum,
)
from experiments.studies.stability.case import Forms, case

D = 250_000
correlation_case = partial(
    case, "correlations", unit="correlation", ours="mean_pair_correlations", tolerance=1e-10
)


def exact_mean(samples: NDArray[Any]) -> float:
    """C_ll of integer samples [N_s, D]: no rounding but that of the result.

    Raises:
        ValueError: if a sum of products might not fit in 64 bits.
    """
    # A shift changes no covariance, and keeps the numbers small.
    rows = samples.astype(np.int64) - samples.min(1, keepdims=True)
    n, d = rows.shape
    if int(rows.max()) ** 2 * d >= 2**63:
        raise ValueError(f"samples: expected a range whose square times {d} is below 2^63")
    sums = [int(total) for total in rows.sum(1)]
    with mpmath.workdps(50):

        def covariance(i: int, j: int) -> Any:
            return mpmath.mpf(d * int(rows[i] @ rows[j]) - sums[i] * sums[j])

        deviation = [mpmath.sqrt(covariance(i, i)) for i in range(n)]
        pairs = [
            covariance(i, j) / (deviation[i] * deviation[j])
            for i, j in itertools.combinations(range(n), 2)
        ]
        return float(mpmath.fsum(pairs) / len(pairs))


def one_pass(x: NDArray[Any], y: NDArray[Any]) -> float:
    """The textbook's (⟨xy⟩ − ⟨x⟩⟨y⟩)/√(…), in the type of the samples."""
    covariance = (x * y).mean() - x.mean() * y.mean()
    variances = ((x * x).mean() - x.mean() ** 2) * ((y * y).mean() - y.mean() ** 2)
    return float(covariance / np.sqrt(variances))


def correlated(d: int, levels: int) -> NDArray[np.int64]:
    """Two frames of integers 0 … levels − 1 that share half of their pixels: [2, d]."""
    frames = np.random.default_rng(0).integers(0, levels, (2, d))
    frames[1, ::2] = frames[0, ::2]
    return frames


def pair(
    naive: Callable[..., float], frames: NDArray[np.int64], given: Any, ours: Any = None
) -> Forms:
    """A computation for one pair of frames, `given` in its type, beside ours for this class."""
    exact, samples = exact_mean(frames), given if ours is None else ours
    return Forms(
        lambda: naive(*given),
        lambda: mean_pair_correlations(samples, samples).value,
        lambda value: abs(value - exact),
    )


@correlation_case(
    extreme="16-bit frames, mean 10^6 times the deviation: 65,000² has 10 digits, float32 seven",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ in float32",
    small={"d": 20_000},
)
def mean_far_above_the_deviation(d: int = D) -> Forms:
    frames = 65_000 + (correlated(d, 236) == 0)  # one pixel in 236 is brighter by one
    return pair(one_pass, frames, frames.astype(np.float32), frames.astype(np.uint16))


@correlation_case(
    extreme="mean 10^9, deviation 577: float64 loses 12 of its 16 digits",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ in float64",
    small={"d": 20_000},
)
def mean_far_above_the_deviation_in_float64(d: int = D) -> Forms:
    frames = 10**9 + correlated(d, 2000)
    return pair(one_pass, frames, frames.astype(np.float64))


@correlation_case(
    extreme="16-bit frames up to 65,535: products in uint16 wrap",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ of the camera's integers",
    small={"d": 20_000},
)
def sixteen_bit_frames(d: int = D) -> Forms:
    frames = correlated(d, 65_536)
    return pair(one_pass, frames, frames.astype(np.uint16))


@correlation_case(
    extreme="pixels of 10^-200: their squares are zero in float64, a variance of zero gives NaN",
    naive="numpy.corrcoef",
    small={"d": 20_000},
)
def squares_that_underflow(d: int = D) -> Forms:
    frames = correlated(d, 4096)
    # Scaled by a power of two: exact.
    return pair(lambda x, y: np.corrcoef(x, y)[0, 1], frames, frames * 2.0**-664)


@correlation_case(
    extreme="N_s = 2: one pair; the mean over a whole Gram matrix counts each frame with itself",
    naive="mean of numpy.corrcoef",
    tolerance=1e-12,
    small={"d": 20_000},
)
def two_samples_a_class(d: int = D) -> Forms:
    frames = correlated(d, 256)
    return pair(lambda *both: np.corrcoef(both).mean(), frames, frames.astype(np.uint8))


@correlation_case(
    extreme="30 samples: 870 ordered pairs for the double sum, one product a sample for ours",
    naive="double sum of Eq. 4 in float64",
    tolerance=1e-12,
    small={"n": 5, "d": 2500},
)
def many_pairs(n: int = 30, d: int = 25_000) -> Forms:
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 200, (n, d)) + rng.integers(0, 56, d)
    exact, samples = exact_mean(frames), frames.astype(np.uint8)
    return Forms(
        lambda: pair_correlations_double_sum(samples, samples).value,
        lambda: mean_pair_correlations(samples, samples).value,
        lambda value: abs(value - exact),
    )
