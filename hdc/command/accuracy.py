"""How often a model was right, in words: accuracy with its interval, and what was confused."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

_NAMED = 20  # classes up to which all confusions are told as a table


def accuracy(confusion: np.ndarray) -> str:
    """The share on the diagonal of a table of confusions [L, L], with Wilson's 95 % interval."""
    right, n = int(np.trace(confusion)), int(confusion.sum())
    low, high = wilson(right, n)
    return (
        f"accuracy {right / n:.1%} (95 % interval {low:.1%} to {high:.1%}), {right} of {n} frames"
    )


def wilson(right: float, n: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of a proportion, of right ones among n (Wilson, JASA 22, 209 (1927))."""
    z = NormalDist().inv_cdf((1 + level) / 2)
    share = right / n
    middle = share + z * z / (2 * n)
    half = z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = ((middle + sign * half) / (1 + z * z / n) for sign in (-1, 1))
    return max(0.0, float(low)), min(1.0, float(high))


def confusions(names: Sequence[str], counts: np.ndarray) -> list[str]:
    """A table of counts [L, L], a row a true class; of many classes, only what was confused."""
    if len(names) > _NAMED:
        pairs = sorted(zip(*np.nonzero(counts - np.diag(np.diag(counts))), strict=True),
                       key=lambda pair: -counts[pair])  # fmt: skip
        return [f"{names[i]} → {names[j]}: {counts[i, j]}" for i, j in pairs]
    numbers = [str(i + 1) for i in range(len(names))]
    width = max(map(len, names))
    cell = max(map(len, [*numbers, *map(str, counts.ravel())]))
    lines = [" ".join([" " * (len(numbers[-1]) + 1 + width), *(f"{k:>{cell}}" for k in numbers)])]
    for k, name, row in zip(numbers, names, counts, strict=True):
        cells = (f"{n:>{cell}}" for n in row)
        lines.append(" ".join([f"{k:>{len(numbers[-1])}} {name:{width}}", *cells]))
    return ["rows are the true classes, columns the predicted ones", *lines]
