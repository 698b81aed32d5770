"""What a run's predictions amount to: accuracy, interval, confusion."""

from __future__ import annotations

import numpy as np


def accuracy(predicted: np.ndarray, labels: np.ndarray) -> float:
    """Fraction of right predictions."""
    return float((np.asarray(predicted) == labels).mean())


def wilson(n_right: int, n: int) -> tuple[float, float]:
    """95 % Wilson interval of a fraction n_right / n."""
    from scipy.stats import binomtest

    interval = binomtest(n_right, n).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def confusion(predicted: np.ndarray, labels: np.ndarray, n_classes: int) -> np.ndarray:
    """Counts int64 [L, L]: row, true class; column, predicted class."""
    pairs = labels * n_classes + np.asarray(predicted)
    return np.bincount(pairs, minlength=n_classes**2).reshape(n_classes, n_classes)


def mcnemar(a_right: np.ndarray, b_right: np.ndarray) -> float:
    """Exact McNemar test: p-value of two models being right equally often on the same samples."""
    from scipy.stats import binomtest

    only_a = int((a_right & ~b_right).sum())
    only_b = int((b_right & ~a_right).sum())
    return float(binomtest(only_a, only_a + only_b).pvalue) if only_a + only_b else 1.0
