"""Accuracy, its confidence interval, and R²."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np


def accuracy(predicted: np.ndarray, labels: np.ndarray) -> float:
    """Fraction of predictions that are right."""
    return float((np.asarray(predicted) == labels).mean())


def wilson(n_right: float, n: float) -> tuple[float, float]:
    """Wilson's 95 % interval of a fraction p = n_right / n (JASA 22, 209 (1927)).

    (p + z²/2n ± z·√(p(1 − p)/n + z²/4n²)) / (1 + z²/n), with the normal quantile z of 97.5 %.

    Written out here, since importing scipy.stats takes as long as a short run.
    """
    z = NormalDist().inv_cdf(0.975)
    p, z2_n = n_right / n, z * z / n
    variance = p * (1 - p) + z2_n / 4
    half = math.sqrt(z2_n * variance)
    centre = p + z2_n / 2
    low = (centre - half) / (1 + z2_n)
    high = (centre + half) / (1 + z2_n)
    # Exact at the ends, which rounding would miss.
    if n_right <= 0:
        low = 0.0
    if n_right >= n:
        high = 1.0
    return low, high


def r_squared(truth: np.ndarray, predicted: np.ndarray) -> float:
    """Coefficient of determination R² of numbers [Q]: 1 − Σ(y − ŷ)²/Σ(y − ȳ)².

    If all numbers are equal, R² is 1 where each is predicted exactly, else 0.
    """
    error = ((truth - predicted) ** 2).sum()
    spread = ((truth - truth.mean()) ** 2).sum()
    if spread == 0:
        return float(error == 0)
    return float(1 - error / spread)
