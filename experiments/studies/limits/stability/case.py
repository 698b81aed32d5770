"""A case: an extreme input, by the naive computation and by ours, against an exact reference."""

from __future__ import annotations

import math
import time
import timeit
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.records.rows import Row


def largest(result: Any, exact: Any) -> float:
    """Largest distance from the exact result."""
    return float(np.abs(np.asarray(result, float) - np.asarray(exact, float)).max())


def relative(result: Any, exact: Any) -> float:
    """Distance from the exact result over its size, both as Euclidean norms."""
    exact = np.asarray(exact, float)
    apart = np.linalg.norm(np.asarray(result, float) - exact)
    return float(apart / np.linalg.norm(exact))


def differing(result: Any, exact: Any) -> float:
    """Number of entries that differ from the exact ones."""
    return float((np.asarray(result) != np.asarray(exact)).sum())


@dataclass(frozen=True)
class Case:
    """The computations in words, the unit of the error, and `prepare`, which makes the input.

    It returns two functions without arguments, the naive computation and ours, the exact result,
    and the error that ours may have, if any.
    """

    part: str
    case: str
    extreme: str
    naive: str
    ours: str
    unit: str
    error: Callable[[Any, Any], float]
    prepare: Callable[[], tuple[Any, ...]]

    def row(self) -> Row:
        """Errors, CPU times, and the verdict."""
        naive, ours, exact, *derived = self.prepare()
        (tolerance,) = derived or (0.0,)
        texts = {
            name: text for name, text in vars(self).items() if isinstance(text, str)
        }
        error_naive, time_naive = self._measured(naive, exact)
        error_ours, time_ours = self._measured(ours, exact)
        holds = error_ours is not None and error_ours <= tolerance
        return texts | {
            "tolerance": tolerance,
            "error_naive": error_naive,
            "error_ours": error_ours,
            "time_naive_s": time_naive,
            "time_ours_s": time_ours,
            "verdict": "holds" if holds else "fails",
        }

    def _measured(
        self, compute: Callable[[], Any], exact: Any
    ) -> tuple[float | None, float | None]:
        """The error of a computation, None where it gives no number (0/0), and the CPU time of a
        second call; None for both where it raises."""
        with np.errstate(invalid="raise"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                value = float(self.error(compute(), exact))
                seconds = timeit.timeit(compute, timer=time.process_time, number=1)
            except (ArithmeticError, RuntimeError, ValueError):
                return None, None
        return (value if math.isfinite(value) else None), seconds
