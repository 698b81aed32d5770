"""A case: an extreme input, by the obvious implementation and by ours."""

from __future__ import annotations

import math
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
    """Largest relative distance from the exact result."""
    return largest(np.asarray(result, float) / np.asarray(exact, float), 1)


def differing(result: Any, exact: Any) -> float:
    """Number of entries that differ from the exact ones."""
    return float((np.asarray(result) != np.asarray(exact)).sum())


@dataclass(frozen=True)
class Case:
    """The computations in words, the unit of the error, and `prepare`, which makes the input.

    It returns two functions without arguments, the obvious computation and ours, the exact result,
    and the tolerance where that is derived from the input.
    """

    part: str
    extreme: str
    naive: str
    ours: str
    unit: str
    name: str
    prepare: Callable[[], tuple[Any, ...]]
    error: Callable[[Any, Any], float] = largest
    tolerance: float = 0.0

    def row(self) -> Row:
        """Both errors and the verdict."""
        naive, ours, exact, *derived = self.prepare()
        tolerance = derived[0] if derived else self.tolerance
        error_ours = self._error(ours, exact)
        holds = error_ours is not None and error_ours <= tolerance
        same = ("part", "extreme", "naive", "ours", "unit")
        return {
            "case": self.name,
            **{name: getattr(self, name) for name in same},
            "tolerance": tolerance,
            "error_naive": self._error(naive, exact),
            "error_ours": error_ours,
            "verdict": "holds" if holds else "fails",
        }

    def _error(
        self,
        compute: Callable[[], Any],
        exact: Any,
    ) -> float | None:
        """The error of a computation; None where it raises or gives no number (0/0)."""
        with np.errstate(invalid="raise"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                value = float(self.error(compute(), exact))
            except (ArithmeticError, RuntimeError, ValueError):
                return None
        return value if math.isfinite(value) else None


CASES: list[Case] = []
"""Every case, once the modules of ``cases`` are imported."""


def case(*texts: Any, name: str = "", **rest: Any) -> Any:
    """Register a function as the `prepare` of a :class:`Case` with these attributes."""

    def register(prepare: Any) -> Any:
        words = name or prepare.__name__.replace("_", " ")
        CASES.append(
            Case(
                *texts,
                **{
                    "name": words,
                    "prepare": prepare,
                    **rest,
                },
            )
        )
        return prepare

    return register
