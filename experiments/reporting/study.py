"""What a study gives to the report: a question, and its answer as tables, figures and numbers.

A study is a folder of ``experiments/studies`` with a module ``view`` that has a ``STUDY``. The
report finds it there; nothing else has to know of it.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from experiments.records.results import Results
from experiments.reporting.estimates import Estimate
from experiments.reporting.table import Table

RUN = "python -m experiments.run experiment="


@dataclass(frozen=True)
class Plot:
    """A figure that is drawn when it is needed.

    Attributes:
        name: stem of its file, and its anchor on the page.
        caption: what it shows, for who sees it and who does not.
        draw: makes the matplotlib figure.
        commands: what makes the results again that it is drawn from.
        kind: ``svg``, or ``webp`` for what is made of pixels.
    """

    name: str
    caption: str
    draw: Callable[[], Any]
    commands: Sequence[str] = ()
    kind: str = "svg"


@dataclass(frozen=True)
class Quantity:
    """A number that the paper gives, too, or that stands for a claim of it.

    Attributes:
        name: ``experiment/quantity`` of published.csv.
        value: as measured, in the unit of published.csv; a text where it was not reached.
        low, high: bounds at 95 %, None where unknown.
        interval: what the bounds are.
        condition: what tells values of one quantity apart where the paper leaves it open.
        n: test samples, or frames, of all seeds.
        seeds: how many.
        made_by: command that measures it again.
        note: what a reader has to know.
    """

    name: str
    value: float | str
    low: float | None = None
    high: float | None = None
    interval: str = ""
    condition: str = ""
    n: int | None = None
    seeds: int | None = None
    made_by: str = ""
    note: str = ""

    @classmethod
    def of(
        cls, name: str, found: Estimate, interval: str, scale: float = 1.0, **rest: Any
    ) -> Quantity:
        """From an estimate, in a unit of 1/scale; its bounds are unknown where they are NaN."""
        low, high = (None if math.isnan(bound) else scale * bound for bound in found[1:])
        known = interval if low is not None or high is not None else ""
        return cls(name, scale * found.value, low, high, known, **rest)


def _nothing(_: Results) -> Iterable[Any]:
    return ()


@dataclass(frozen=True)
class Study:
    """One question.

    Attributes:
        name: its folder.
        title: heading on the page.
        question: what it asks, in a sentence or two.
        order: place on the page; smaller comes first.
        tables, plots, quantities: made of a results folder; none where it has no records for them.
        front: whether it stands unfolded on the page, before the others.
    """

    name: str
    title: str
    question: str
    order: float
    tables: Callable[[Results], Iterable[Table]] = _nothing
    plots: Callable[[Results], Iterable[Plot]] = _nothing
    quantities: Callable[[Results], Iterable[Quantity]] = _nothing
    front: bool = False


def studies(package: ModuleType) -> list[Study]:
    """Every study of a package of studies, in the order of the page."""
    names = (found.name for found in pkgutil.iter_modules(package.__path__) if found.ispkg)
    views = (importlib.import_module(f"{package.__name__}.{name}.view") for name in names)
    found = [view.STUDY for view in views]
    return sorted(found, key=lambda study: (not study.front, study.order))
