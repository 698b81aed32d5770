"""Mean correlations over pairs (Eqs. 4 and 5 of the paper); the reference is exact integer sums."""

from __future__ import annotations

import itertools
from functools import partial
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from experiments.studies.correlation.sums import (
    mean_pair_correlations,
    pair_correlations_double_sum,
)
from experiments.studies.stability.case import Trial, case

correlation_case = partial(case, "correlations")

D = 250_000
WORDS: dict[str, Any] = {
    "reference": "integer sums, roots by mpmath",
    "unit": "correlation",
    "ours": "correlation.mean_pair_correlations",
}


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
    rng = np.random.default_rng(0)
    frames = rng.integers(0, levels, (2, d))
    frames[1, ::2] = frames[0, ::2]
    return frames


def beside_exact(
    naive: Any, frames: NDArray[Any], exact: float, ours: NDArray[Any] | None = None
) -> Trial:
    """A form for one pair of frames beside ours for a class of these two samples."""
    samples = frames if ours is None else ours
    return Trial(
        naive=lambda: naive(*frames),
        ours=lambda: mean_pair_correlations(samples, samples).value,
        error=lambda value: abs(value - exact),
    )


@correlation_case(
    extreme="16-bit frames whose mean is 10^6 times their deviation, as float32",
    expected="10 digits; ⟨xy⟩ − ⟨x⟩⟨y⟩ keeps none, as 65,000² has 10 and float32 seven",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ in float32",
    tolerance=1e-10,
    small={"d": 20_000},
    **WORDS,
)
def mean_far_above_the_deviation(d: int = D) -> Trial:
    rare = correlated(d, 236) == 0  # one pixel in 236 is brighter by one: deviation 0.065
    frames = 65_000 + rare
    wide = frames.astype(np.float32)
    return beside_exact(one_pass, wide, exact_mean(frames), frames.astype(np.uint16))


@correlation_case(
    extreme="mean 10^9, deviation 577, as float64",
    expected="10 digits; ⟨xy⟩ − ⟨x⟩⟨y⟩ loses 12 of its 16",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ in float64",
    tolerance=1e-10,
    small={"d": 20_000},
    **WORDS,
)
def mean_far_above_the_deviation_in_float64(d: int = D) -> Trial:
    frames = 10**9 + correlated(d, 2000)
    return beside_exact(one_pass, frames.astype(np.float64), exact_mean(frames))


@correlation_case(
    extreme="16-bit frames up to 65,535",
    expected="10 digits; products in uint16 wrap",
    naive="⟨xy⟩ − ⟨x⟩⟨y⟩ of the camera's integers",
    tolerance=1e-10,
    small={"d": 20_000},
    **WORDS,
)
def sixteen_bit_frames(d: int = D) -> Trial:
    frames = correlated(d, 65_536)
    return beside_exact(one_pass, frames.astype(np.uint16), exact_mean(frames))


@correlation_case(
    extreme="pixels of 10^-200: their squares are zero in float64",
    expected="10 digits, as a correlation does not depend on the unit; a variance of zero is NaN",
    naive="numpy.corrcoef",
    tolerance=1e-10,
    small={"d": 20_000},
    **WORDS,
)
def squares_that_underflow(d: int = D) -> Trial:
    frames = correlated(d, 4096)
    scaled = frames * 2.0**-664  # a power of two: exact
    return beside_exact(lambda x, y: np.corrcoef(x, y)[0, 1], scaled, exact_mean(frames))


@correlation_case(
    extreme="N_s = 2: one pair, against two frames with themselves",
    expected="the correlation of the pair; the mean over a whole Gram matrix counts k = k′ as 1",
    naive="mean of numpy.corrcoef",
    tolerance=1e-12,
    small={"d": 20_000},
    **WORDS,
)
def two_samples_a_class(d: int = D) -> Trial:
    frames = correlated(d, 256)
    bytes_ = frames.astype(np.uint8)
    return beside_exact(lambda *pair: np.corrcoef(pair).mean(), bytes_, exact_mean(frames))


@correlation_case(
    extreme="30 samples of 25,000 pixels: 870 ordered pairs",
    expected="both to 12 digits; the class sum takes one product a sample, the double sum N_s − 1",
    naive="double sum of Eq. 4 in float64",
    tolerance=1e-12,
    small={"n": 5, "d": 2500},
    **WORDS,
)
def many_pairs(n: int = 30, d: int = 25_000) -> Trial:
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 200, (n, d)) + rng.integers(0, 56, d)
    exact, bytes_ = exact_mean(frames), frames.astype(np.uint8)
    return Trial(
        naive=lambda: pair_correlations_double_sum(bytes_, bytes_).value,
        ours=lambda: mean_pair_correlations(bytes_, bytes_).value,
        error=lambda value: abs(value - exact),
    )
