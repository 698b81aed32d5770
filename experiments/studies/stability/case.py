"""A case: an input at the edge of what numbers can do, computed the obvious way and ours."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from experiments.protocol.experiment import Row


class Forms(NamedTuple):
    """A prepared case.

    Attributes:
        naive: the obvious computation, as a practitioner would write it.
        ours: the computation of this project.
        error: error of a result of either, against an exact reference.
        tolerance: instead of the case's, where it depends on the input.
    """

    naive: Callable[[], Any]
    ours: Callable[[], Any]
    error: Callable[[Any], float]
    tolerance: float | None = None


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is computed, and why it is hard.

    Attributes:
        part: hypervectors, correlations, training or layer.
        name: of the function that prepares it, in words.
        prepare: makes the input.
        extreme: what is extreme about the input, and where the obvious computation fails.
        naive, ours: the two computations, in words.
        unit: of the error.
        tolerance: the largest error of ours for which the case holds.
        small: arguments of `prepare` for a quick look.
    """

    part: str
    name: str
    prepare: Callable[..., Forms]
    extreme: str
    naive: str
    ours: str
    unit: str
    tolerance: float = 0.0
    small: Mapping[str, Any] = field(default_factory=dict)

    def row(self, small: bool = False) -> Row:
        """Both errors and the verdict."""
        forms = self.prepare(**(self.small if small else {}))
        error_naive, error_ours = (_error(forms.error, _try(x)) for x in (forms.naive, forms.ours))
        tolerance = self.tolerance if forms.tolerance is None else forms.tolerance
        holds = error_ours is not None and error_ours <= tolerance
        return {
            "part": self.part,
            "case": self.name,
            "extreme": self.extreme,
            "naive": self.naive,
            "ours": self.ours,
            "unit": self.unit,
            "error_naive": error_naive,
            "error_ours": error_ours,
            "tolerance": tolerance,
            "verdict": "holds" if holds else "fails",
        }


CASES: list[Case] = []
"""Every case, once the modules of ``cases`` are imported."""


def case(part: str, name: str = "", **attributes: Any) -> Callable[[Any], Any]:
    """Register a function as a :class:`Case` with these attributes."""

    def register(prepare: Callable[..., Forms]) -> Callable[..., Forms]:
        words = name or prepare.__name__.replace("_", " ")
        CASES.append(Case(part=part, name=words, prepare=prepare, **attributes))
        return prepare

    return register


def _try(call: Callable[[], Any]) -> Any:
    """The result of a call without its warnings, or None if it raises."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return call()
        except (ArithmeticError, RuntimeError, ValueError):
            return None


def _error(error: Callable[[Any], float], result: Any) -> float | None:
    """The error of a result; None where there is no number to compare."""
    value = math.nan if result is None else float(error(result))
    return value if math.isfinite(value) else None
