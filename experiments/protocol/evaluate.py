"""Accuracy of predictions, its interval, and the confusion matrix."""

from __future__ import annotations

import math

import numpy as np

_Z = 1.959963984540054  # 97.5 % point of the normal distribution


def accuracy(predicted: np.ndarray, labels: np.ndarray) -> float:
    """Fraction of right predictions."""
    return float((np.asarray(predicted) == labels).mean())


def wilson(n_right: int, n: int) -> tuple[float, float]:
    """95 % Wilson interval of a fraction p = n_right / n.

    (p + z²/2n ± z·√(p(1 − p)/n + z²/4n²)) / (1 + z²/n)

    Written out: importing scipy.stats takes as long as a run.
    """
    p, z2_n = n_right / n, _Z**2 / n
    half = math.sqrt(z2_n * (p * (1 - p) + z2_n / 4))
    low, high = ((p + z2_n / 2 + side * half) / (1 + z2_n) for side in (-1, 1))
    return (low if n_right > 0 else 0.0), (high if n_right < n else 1.0)


def confusion(predicted: np.ndarray, labels: np.ndarray, n_classes: int) -> np.ndarray:
    """Counts int64 [L, L]: row, true class; column, predicted class."""
    pairs = labels * n_classes + np.asarray(predicted)
    return np.bincount(pairs, minlength=n_classes**2).reshape(n_classes, n_classes)
