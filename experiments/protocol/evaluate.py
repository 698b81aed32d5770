"""What a run's predictions amount to: accuracy, interval, confusion."""

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

    Written out, here and below: importing scipy.stats takes as long as a run.
    """
    p, z2_n = n_right / n, _Z**2 / n
    half = math.sqrt(z2_n * (p * (1 - p) + z2_n / 4))
    low, high = ((p + z2_n / 2 + side * half) / (1 + z2_n) for side in (-1, 1))
    return (low if n_right > 0 else 0.0), (high if n_right < n else 1.0)


def confusion(predicted: np.ndarray, labels: np.ndarray, n_classes: int) -> np.ndarray:
    """Counts int64 [L, L]: row, true class; column, predicted class."""
    pairs = labels * n_classes + np.asarray(predicted)
    return np.bincount(pairs, minlength=n_classes**2).reshape(n_classes, n_classes)


def mcnemar(a_right: np.ndarray, b_right: np.ndarray) -> float:
    """Exact McNemar test: p-value of two models being right equally often on the same samples.

    Args:
        a_right, b_right: which samples each model has right, bool [Q].
    """
    a_right, b_right = np.asarray(a_right, bool), np.asarray(b_right, bool)
    only_a, only_b = int((a_right & ~b_right).sum()), int((b_right & ~a_right).sum())
    n = only_a + only_b
    tail = sum(math.comb(n, k) for k in range(min(only_a, only_b) + 1))
    return min(1.0, 2 * tail / 2**n)
