"""A case: an input at the edge of what numbers can do, done the obvious way and done our way.

A case is a function with the decorator :func:`case`, which says in words what is extreme and what
is expected. The function prepares the input and returns a :class:`Trial`: the two forms, and the
error of a result against a reference that is exact. What is expected stands beside it; a case that
fails stays, with a note that says why.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

REFUSAL = "inputs not refused"  # unit of the error of an input that has to be refused


@dataclass(frozen=True)
class Trial:
    """The two forms of a case, and how wrong a result is.

    Attributes:
        naive: the obvious method, as a practitioner would write it.
        ours: what this project does.
        error: of a result of either form. A form that raises has its exception as the result; an
            `error` that cannot use it may raise in turn, and the error is then infinite.
        tolerance: instead of the case's own, where it depends on the input.
        remark: numbers worth telling beside the verdict.
    """

    naive: Callable[[], Any]
    ours: Callable[[], Any]
    error: Callable[[Any], float]
    tolerance: float | None = None
    remark: Callable[[], str] | None = None


@dataclass(frozen=True)
class Case:
    """What a case is about; see :func:`case`."""

    part: str
    name: str
    extreme: str
    expected: str
    reference: str
    unit: str
    naive: str
    ours: str
    tolerance: float
    note: str
    prepare: Callable[..., Trial]
    small: Mapping[str, Any] = field(default_factory=dict)

    def trial(self, small: bool = False) -> Trial:
        """The input prepared, in its full size or, for a quick look, in the small one."""
        return self.prepare(**self.small) if small else self.prepare()


CASES: list[Case] = []


def case(
    part: str,
    *,
    extreme: str,
    expected: str,
    reference: str,
    unit: str,
    naive: str,
    ours: str,
    tolerance: float = 0.0,
    note: str = "",
    small: Mapping[str, Any] | None = None,
) -> Callable[[Callable[..., Trial]], Callable[..., Trial]]:
    """Register a function as a case; its name is the case's.

    Args:
        part: of the project, as :data:`experiments.stability.PARTS` has them.
        extreme: what is extreme about the input.
        expected: what is expected of both forms.
        reference: what the results are compared with; exact.
        unit: what the error counts or measures.
        naive, ours: the two forms, in words.
        tolerance: the largest error of ours for which the case holds.
        note: why, for a case that fails.
        small: arguments of the function for a quick look.

    Raises:
        ValueError: for a second case of the same name in one of the parts.
    """

    def register(prepare: Callable[..., Trial]) -> Callable[..., Trial]:
        name = prepare.__name__.replace("_", " ")
        if any((known.part, known.name) == (part, name) for known in CASES):
            raise ValueError(f"{part}: expected one case named {name!r}, found two")
        CASES.append(
            Case(part, name, extreme, expected, reference, unit, naive, ours, tolerance, note,
                 prepare, small or {})
        )  # fmt: skip
        return prepare

    return register


def outcome(form: Callable[[], Any]) -> Any:
    """The result of a form, or the exception it raised; its warnings are not shown."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return form()
        except Exception as error:
            return error


def error_of(trial: Trial, result: Any) -> float:
    """The error of an outcome as a float: infinite where there is no result to compare."""
    try:
        return float(trial.error(result))
    except Exception:
        if isinstance(result, Exception):
            return math.inf
        raise


def verdict(error: float, tolerance: float) -> str:
    """``holds`` if the error is at most the tolerance; NaN is no error to hold by."""
    return "holds" if error <= tolerance else "fails"


def refusal(*words: str) -> Callable[[Any], float]:
    """An error for inputs to be refused: 0 for a ValueError that has these words in it, else 1."""

    def error(result: Any) -> float:
        refused = isinstance(result, ValueError) and all(word in str(result) for word in words)
        return 0.0 if refused else 1.0

    return error
