"""Estimators: one for each kind of quantity, whoever asks for it.

Seeds are the units: each has a sensor, a session and a split of its own, and the test samples of
one are alike. So intervals are Student's over seeds. Shares of samples cannot spread less over
seeds than their samples make them; where they happen to (all are 100 %, say), that least variance
takes the place of theirs. A recording is of one sensor, and its seeds only choose other frames of
it: they count as one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.records.rows import unpack_labels
from experiments.reporting.text import CAPTURED, kind_of
from hdc.accuracy import wilson

# Columns of runs that a paired difference needs.
_PAIRED = ["seeds", "test_set", "origin", "n_test", "right", "labels", "predicted"]
_LEVEL = 0.9  # the accuracy that the paper exceeds for N > 20


class Estimate(NamedTuple):
    """A value and its 95 % interval; bounds are NaN where they are not known."""

    value: float
    low: float = math.nan
    high: float = math.nan

    def within(self, low: float, high: float) -> Estimate:
        """The same with bounds that end where its values do."""
        bounds = np.clip(self[1:], low, high)
        return Estimate(self.value, *bounds.tolist())

    def columns(self, name: str) -> dict[str, float]:
        """The value under a name, its bounds under ``name_low`` and ``name_high``."""
        return {
            name: self.value,
            f"{name}_low": self.low,
            f"{name}_high": self.high,
        }


def mean_interval(values: Sequence[float], least: float = 0.0) -> Estimate:
    """Mean of values, one per seed, and Student's interval of their mean; a value has at least
    the variance `least`."""
    return _student(values, least, 1 / len(values))


def one_sensor(values: Sequence[float], least: float = 0.0) -> Estimate:
    """Like :func:`mean_interval`, with the interval for one more value: mean ± t·s·√(1 + 1/n)."""
    return _student(values, least, 1 + 1 / len(values))


def least_variance(shares: Sequence[float], n: float) -> float:
    """Variance that a share of n samples has whatever the sensor: p(1 − p)/n, p of the samples of
    all seeds with two right and two wrong added (Agresti and Coull, Am. Stat. 52, 119 (1998))."""
    right, asked = sum(shares) * n, len(shares) * n
    p = (right + 2) / (asked + 4)
    return p * (1 - p) / n


def least_variance_of_difference(disagree: float, asked: float, n: float) -> float:
    """Variance that a difference of two shares of the same n samples has whatever the sensor:
    (m + 1)/(asked + 2)/n, with m of the samples asked those on which the two disagree (Agresti and
    Min, Stat. Med. 24, 729 (2005))."""
    return (disagree + 1) / (asked + 2) / n


def mean_share(shares: Sequence[float], n: float) -> Estimate:
    """Share of right samples, mean over seeds with Student's interval; of one seed Wilson's; `n`
    samples per seed."""
    if len(shares) < 2:
        right = round(shares[0] * n)
        return Estimate(shares[0], *wilson(right, round(n)))
    return mean_interval(shares, least_variance(shares, n)).within(0, 1)


def mean_difference(
    differences: Sequence[float], n: float, disagree: float
) -> Estimate:
    """Difference of two shares on the same n samples, mean over seeds with Student's interval. Its
    least variance is that of the samples on which the two `disagree`, of all seeds together."""
    least = least_variance_of_difference(disagree, n * len(differences), n)
    return mean_interval(differences, least).within(-1, 1)


def median_interval(values: Sequence[float]) -> Estimate:
    """Median with its order-statistic interval, which needs no law of errors; infinite values count
    as larger than all others.

    The bounds are the j-th smallest and the j-th largest value, with the largest j for which the
    median lies between them with a probability of 95 % at least; NaN with fewer than six values.
    """
    from scipy.special import bdtr  # of a binomial count

    ordered = sorted(values)
    n = len(ordered)
    middle = float(np.median(ordered)) if math.isfinite(ordered[n // 2]) else math.inf
    ranks = [j for j in range(1, n // 2 + 1) if bdtr(j - 1, n, 0.5) <= 0.025]
    if not ranks:
        return Estimate(middle)
    j = max(ranks)
    return Estimate(middle, float(ordered[j - 1]), float(ordered[n - j]))


def median_range(values: Sequence[float]) -> Estimate:
    """:func:`median_interval`; of too few values for it, from the lowest to the highest."""
    found = median_interval(values)
    if len(values) > 1 and math.isnan(found.low):
        return Estimate(found.value, float(min(values)), float(max(values)))
    return found


def share(runs: pd.DataFrame) -> Estimate:
    """Test accuracy of the runs of one row, as :func:`mean_share`; one recording counts as one
    seed."""
    shares, n = _shares(runs)
    if are_of_one_recording(runs):
        shares = [float(np.mean(shares))]
    return mean_share(shares, n)


def share_of_one_sensor(runs: pd.DataFrame) -> Estimate:
    """Test accuracy, mean over seeds with the interval for one more sensor."""
    shares, n = _shares(runs)
    return one_sensor(shares, least_variance(shares, n)).within(0, 1)


def difference(runs: pd.DataFrame, reference: pd.DataFrame) -> Estimate | None:
    """How much more accurate a model is than another, paired by seed; None without a pair.

    That test samples are the same is proven by the digest of their frames and labels. There is no
    interval on one recording.
    """
    ours, theirs = runs[_PAIRED], reference[_PAIRED]
    paired = ours.merge(
        theirs, on=["seeds", "test_set"], suffixes=("", "_of_reference")
    )
    if not len(paired):
        return None
    differences = (paired.right - paired.right_of_reference) / paired.n_test
    if are_of_one_recording(paired):
        return Estimate(float(differences.mean()))
    answers = zip(
        paired.labels, paired.predicted, paired.predicted_of_reference, strict=True
    )
    disagree = sum(_disagree(*texts) for texts in answers)
    n = float(paired.n_test.mean())
    return mean_difference(differences.tolist(), n, disagree)


def _disagree(labels: str, predicted: str, other: str) -> int:
    """On how many test samples one of two models is right and the other is not."""
    truth = unpack_labels(labels)
    right = unpack_labels(predicted) == truth
    return int((right != (unpack_labels(other) == truth)).sum())


def are_of_one_recording(runs: pd.DataFrame) -> bool:
    """Whether the seeds of some runs only choose frames of one recording, all of one sensor."""
    return kind_of(runs.origin.iloc[0]) == CAPTURED


def crossing(n: Sequence[float], accuracy: Sequence[float]) -> float:
    """N at which a curve first rises above 90 %, between two N on a line; NaN if it never does."""
    order = np.argsort(n)
    x = np.asarray(n, float)[order]
    y = np.asarray(accuracy, float)[order]
    above = np.flatnonzero(y > _LEVEL)
    if not len(above):
        return math.nan
    k = int(above[0])
    if k == 0:
        return float(x[0])
    pair = slice(k - 1, k + 1)
    return float(np.interp(_LEVEL, y[pair], x[pair]))


def _student(
    values: Sequence[float],
    least: float,
    parts: float,
) -> Estimate:
    """Student's interval; `parts` of the variance of a value is that of what is estimated."""
    from scipy.special import stdtrit  # scipy.stats takes as long to import as the rest

    mean, n = float(np.mean(values)), len(values)
    if n < 2:
        return Estimate(mean)
    variance = max(float(np.var(values, ddof=1)), least)
    quantile = float(stdtrit(n - 1, 0.975))
    half = quantile * math.sqrt(variance * parts)
    return Estimate(mean, mean - half, mean + half)


def _shares(runs: pd.DataFrame) -> tuple[list[float], float]:
    """Share of right test samples in each run, and how many test samples a run has."""
    return (runs.right / runs.n_test).tolist(), float(runs.n_test.mean())
