"""Numbers of several laboratories joined to one: a random-effects estimate across sensors.

Each laboratory i has a number y_i with a known variance v_i, and a truth of its own that varies
with variance τ² about the mean of all laboratories, μ. With the weights w_i = 1/(v_i + τ²):

    τ²   solves Σ w_i (y_i − μ)² = k − 1           (Paule and Mandel, J. Res. NBS 87, 377 (1982))
    q    = Σ w_i (y_i − μ)²/(k − 1)
    s²   = max(1, q)/Σ w_i                         (Hartung and Knapp, with the floor)
    mean:        μ ± t(k − 1)·s
    prediction:  μ ± t(k − 2)·√(τ² + s²)           the number of a sensor of another laboratory

The floor is that of Röver, Knapp and Friede, BMC Med. Res. Methodol. 15, 99 (2015), the prediction
interval that of Higgins, Thompson and Spiegelhalter, J. R. Stat. Soc. A 172, 137 (2009).

``statsmodels.stats.meta_analysis.combine_effects`` has neither, and its τ² is zero where the last
step of its iteration passes the root by a rounding; so the root is found by scipy, and a test
compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from experiments.reporting.estimates import Estimate

LEVEL = 0.975  # quantile of a two-sided interval of 95 %
_EXACT = 1e-12  # relative, of τ²


class Pooled(NamedTuple):
    """A mean over laboratories; bounds are NaN where there are too few of them.

    Attributes:
        mean: of the laboratories, with its 95 % interval.
        predicted_low, predicted_high: where the number of a sensor of another laboratory is
            expected, 95 %; unknown with fewer than three laboratories.
        between: τ², the variance between laboratories.
        units: how many laboratories.
    """

    mean: Estimate
    predicted_low: float
    predicted_high: float
    between: float
    units: int


def of_laboratory(
    values: Sequence[float], variances: Sequence[float]
) -> tuple[float, float]:
    """The number of a laboratory with k sensors, their mean, and its variance: the larger of that
    within the sensors and that between them, either over k."""
    k = len(values)
    within = float(np.mean(variances)) / k
    between = float(np.var(values, ddof=1)) / k if k > 1 else 0.0
    return float(np.mean(values)), max(within, between)


def random_effects(values: Sequence[float], variances: Sequence[float]) -> Pooled:
    """The mean over laboratories with its interval, and the interval for a new one.

    Of one laboratory the mean is its number, with the normal interval of its variance, and there is
    no prediction.

    Args:
        values: a number of each laboratory [k].
        variances: of each number [k], above zero.

    Raises:
        ValueError: there is no value, or a variance is not a number above zero.
    """
    from scipy.special import ndtri, stdtrit

    y, v = np.asarray(values, float), np.asarray(variances, float)
    k = len(y)
    if k == 0 or len(v) != k or not (v > 0).all():
        raise ValueError(
            f"expected values with as many variances above zero, found {y} and {v}"
        )
    if k == 1:
        half = float(ndtri(LEVEL)) * math.sqrt(v[0])
        alone = Estimate(float(y[0]), float(y[0]) - half, float(y[0]) + half)
        return Pooled(alone, math.nan, math.nan, 0.0, 1)
    mean, between = _paule_mandel(y, v)
    weights = 1 / (v + between)
    q = float(weights @ (y - mean) ** 2) / (k - 1)
    variance = max(1.0, q) / float(weights.sum())
    half = float(stdtrit(k - 1, LEVEL)) * math.sqrt(variance)
    around = math.nan
    if k > 2:
        around = float(stdtrit(k - 2, LEVEL)) * math.sqrt(between + variance)
    return Pooled(
        Estimate(mean, mean - half, mean + half),
        mean - around,
        mean + around,
        between,
        k,
    )


def _paule_mandel(y: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """μ and τ². The sum falls as τ² grows, so that it has one root or, where laboratories differ
    less than their variances let them, none: then τ² is zero."""
    from scipy.optimize import brentq

    def mean(between: float) -> float:
        return float(np.average(y, weights=1 / (v + between)))

    def excess(between: float) -> float:
        squares = (y - mean(between)) ** 2
        return float((squares / (v + between)).sum()) - (len(y) - 1)

    if excess(0.0) <= 0:
        return mean(0.0), 0.0
    # Each weight is below 1/τ², so that at this τ² the sum is at most k − 1.
    most = float(((y - y.mean()) ** 2).sum()) / (len(y) - 1)
    # By rounding alone, where the variances within are next to nothing.
    if excess(most) >= 0:
        return mean(most), most
    root = brentq(excess, 0.0, most, xtol=_EXACT * most, rtol=_EXACT)
    return mean(root), float(root)
