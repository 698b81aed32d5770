"""A study: a question, and functions of a data frame that answer it as tables, figures and numbers.

A study is a folder of ``experiments/studies`` with a module ``view`` that has a ``STUDY``::

    def updates(frame):
        return frame.groupby(["scene", "model", "method"], as_index=False)...

    STUDY = Study(
        "drift",
        "Drift and recalibration",
        "How many new samples …?",
        order=5,
        tables=[Table("drift_updates", updates, of="drift", title="Accuracy after …")],
    )

Each function takes the lines of :meth:`experiments.records.results.Results.frame` of the
experiments that it names; a table's gives a data frame, a figure's draws on a figure.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.estimates import Estimate
from experiments.reporting.table import (
    Of,
    Table,
    Text,
    commands_of,
    experiments_of,
    text_of,
)

if TYPE_CHECKING:  # matplotlib is slow to load
    from matplotlib.figure import Figure

RUN = "python -m experiments.run experiment="
WIDTH = 3.4  # in, one column of a journal


@dataclass(frozen=True)
class Plot:
    """A figure; it is drawn when it is needed.

    Attributes:
        name: stem of its file, and its anchor on the page.
        draws: takes a matplotlib figure and the frame.
        of: the experiments whose lines it takes.
        caption: what it shows; also the alternative text; may hold ``{frames}``.
        size: width and height in inches.
        kind: ``svg``, or ``webp`` for a figure made of pixels.
        needs: whether there is anything to draw.
        commands: what makes its results again; those of the records if there are none here.
        frame: what it is drawn from.
    """

    name: str
    draws: Callable[[Figure, pd.DataFrame], None]
    of: Of
    caption: Text
    size: tuple[float, float] = (WIDTH, 2.6)
    kind: str = "svg"
    needs: Callable[[pd.DataFrame], bool] = lambda _: True
    commands: Sequence[str] = ()
    frame: pd.DataFrame = field(default_factory=pd.DataFrame)

    def made(self, frame: pd.DataFrame) -> Iterator[Plot]:
        """The figure of the frame of its experiments, if there is anything to draw."""
        if self.needs(frame):
            caption = text_of(self.caption, frame)
            commands = commands_of(self.commands, frame)
            yield replace(self, caption=caption, commands=commands, frame=frame)

    def draw(self) -> Figure:
        """The matplotlib figure."""
        from experiments.reporting.plot import STYLE, plt  # --help need not wait for it

        with plt.rc_context(fname=STYLE):
            figure = plt.figure(figsize=self.size, layout="constrained")
            self.draws(figure, self.frame)
        return figure


@dataclass(frozen=True)
class Numbers:
    """How numbers are made that the paper gives, too: of the experiments' own frames alone."""

    make: Callable[[pd.DataFrame], Iterator[Quantity]]
    of: Of
    name: str = "its numbers"

    def made(self, frame: pd.DataFrame) -> Iterator[Quantity]:
        """The numbers, if there are lines."""
        own = frame[~frame.elsewhere.astype(bool)]
        if len(own):
            yield from self.make(own)


@dataclass(frozen=True)
class Quantity:
    """A number that the paper gives, too.

    Attributes:
        name: ``experiment/quantity`` of published.csv.
        value: in the unit of published.csv; a text where it was not reached, None if not measured.
        low, high: 95 % interval of one more sensor's number; None where unknown.
        interval: what the bounds are.
        condition: tells values of one quantity apart where the paper leaves it open.
        n, seeds: how many test samples, or frames, of all seeds; how many seeds.
        made_by: command that measures it again.
        note: what a reader has to know.
    """

    name: str
    value: float | str | None
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
        cls,
        name: str,
        estimate: Estimate,
        interval: str,
        scale: float = 1.0,
        **rest: Any,
    ) -> Quantity:
        """From an estimate, in a unit of 1/scale; its bounds are unknown where they are NaN."""
        low, high = (
            None if math.isnan(bound) else scale * bound for bound in estimate[1:]
        )
        known = interval if low is not None or high is not None else ""
        return cls(name, scale * estimate.value, low, high, known, **rest)


@dataclass(frozen=True)
class Study:
    """One question.

    Attributes:
        name: its folder.
        title: heading on the page.
        question: a sentence or two.
        order: place on the page; smaller comes first.
        front: whether it stands unfolded on the page, before the others.
        tables, figures, numbers: what answers it, in the order in which they are shown.
    """

    name: str
    title: str
    question: str
    order: float
    front: bool = False
    tables: Sequence[Table] = ()
    figures: Sequence[Plot] = ()
    numbers: Sequence[Numbers] = ()

    def tables_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Table]:
        """Its tables of these results.

        Args:
            results: records.
            failures: takes what fails, so that the others are made all the same; None raises it.
        """
        return self._made("table", self.tables, results, failures)

    def plots_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Plot]:
        """Its figures of these results, not yet drawn; `failures` as :meth:`tables_of`."""
        return self._made("figure", self.figures, results, failures)

    def quantities_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Quantity]:
        """Its numbers of these results; `failures` as :meth:`tables_of`."""
        return self._made("numbers", self.numbers, results, failures)

    def _made(
        self,
        kind: str,
        asked: Sequence[Table | Plot | Numbers],
        results: Results,
        failures: list[Failure] | None,
    ) -> Iterator[Any]:
        """Results from the lines that each takes; nothing where there are none."""
        for one in asked:
            try:
                frame = results.frame(*experiments_of(one.of))
                if len(frame):
                    yield from one.made(frame)
            except Exception as error:
                if failures is None:
                    raise
                failures.append(Failure(self.name, f"{kind} {one.name}", error))


@dataclass(frozen=True)
class Failure:
    """A table, figure or number of a study that could not be made, and why."""

    study: str
    called: str
    error: Exception

    def __str__(self) -> str:
        """One line."""
        text = " ".join(str(self.error).split())
        kind = type(self.error).__name__
        return f"study {self.study} failed at {self.called}: {kind}: {text}"


def studies(package: ModuleType) -> list[Study]:
    """Every study of a package of studies, in the order of the page."""
    names = (
        module.name for module in pkgutil.iter_modules(package.__path__) if module.ispkg
    )
    views = (
        importlib.import_module(f"{package.__name__}.{name}.view") for name in names
    )
    return sorted(
        (v.STUDY for v in views), key=lambda study: (not study.front, study.order)
    )


def own_studies(results: Results) -> list[Study]:
    """Studies of a user's modules that made a measurement, by the ``STUDY`` of the same module.

    A module that cannot be imported from here has none: its rows stay in its records.
    """
    tasks = {measured.task for measured in results.measurements}
    modules = {task.rpartition(".")[0] for task in tasks if task}
    found = []
    for name in sorted(modules):
        if name.partition(".")[0] == "experiments":
            continue
        try:
            module = importlib.import_module(name)
        except ImportError:
            continue
        if hasattr(module, "STUDY"):
            found.append(module.STUDY)
    return found
