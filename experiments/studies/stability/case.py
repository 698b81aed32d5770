"""A case: an input at the edge of what numbers can do, done the obvious way and done our way.

A case is a function with the decorator :func:`case`, which says in words what is extreme and what
is expected. The function prepares the input and returns a :class:`Trial`: the two forms, and the
error of a result against a reference that is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Trial:
    """The two forms of a case, and how wrong a result is.

    Attributes:
        naive: the obvious method, as a practitioner would write it.
        ours: what this project does.
        error: error of a result of either form. A form that raises has its exception as the result;
            an `error` that cannot use it may raise in turn, and the error is then infinite.
        tolerance: instead of the case's own, where it depends on the input.
        remark: numbers worth telling beside the verdict.
    """

    naive: Callable[[], Any]
    ours: Callable[[], Any]
    error: Callable[[Any], float]
    tolerance: float | None = None
    remark: Callable[[], str] | None = None


Prepare = Callable[..., Trial]


@dataclass(frozen=True, kw_only=True)
class Case:
    """What a case is about.

    Attributes:
        part: part of the project.
        name: name of the function that prepares it, in words.
        prepare: makes the input.
        extreme: what is extreme about the input.
        expected: what is expected of both forms.
        reference: what the results are compared with; exact.
        unit: what the error counts or measures.
        naive, ours: the two forms, in words.
        tolerance: the largest error of ours for which the case holds.
        small: arguments of `prepare` for a quick look.
    """

    part: str
    name: str
    prepare: Prepare
    extreme: str
    expected: str
    reference: str
    unit: str
    naive: str
    ours: str
    tolerance: float = 0.0
    small: Mapping[str, Any] = field(default_factory=dict)


CASES: dict[str, Case] = {}
"""Every case by its name, once the modules of ``cases`` are imported."""


def case(part: str, **words: Any) -> Callable[[Prepare], Prepare]:
    """Register a function as a case of a part of the project, under the function's name.

    Args:
        part: hypervectors, correlations, training or sensor.
        words: the other attributes of :class:`Case`.

    Raises:
        ValueError: for a second case of the same name.
    """

    def register(prepare: Prepare) -> Prepare:
        name = prepare.__name__.replace("_", " ")
        if name in CASES:
            raise ValueError(f"{part}: expected one case named {name!r}, found two")
        CASES[name] = Case(part=part, name=name, prepare=prepare, **words)
        return prepare

    return register
