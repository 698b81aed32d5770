"""A study: a question, and functions of a data frame that answer it as tables, figures and numbers.

A study is a folder of ``experiments/studies`` with a module ``view`` that has a ``STUDY``::

    def updates(frame):
        return frame.groupby(["scene", "model", "method"], as_index=False)...

    STUDY = Study(
        "drift",
        "Drift and recalibration",
        "How many new samples …?",
        order=5,
        tables=[TableOf("drift_updates", updates, of="drift", title="Accuracy after …")],
    )

Each function takes the lines of :meth:`experiments.records.results.Results.frame` of the
experiments that it names; a table's gives a data frame, a figure's draws on a figure.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.estimates import Estimate
from experiments.reporting.table import Table
from experiments.reporting.text import counted, frames_of

if TYPE_CHECKING:  # matplotlib is slow to load
    from matplotlib.figure import Figure

RUN = "python -m experiments.run experiment="
WIDTH = 3.4  # in, one column of a journal

Of = str | Sequence[str]  # one experiment, or several; "runs" for single trainings
Text = str | Callable[[pd.DataFrame], str]  # or made of the frame that a function takes
Columns = Mapping[str, Column] | Callable[[pd.DataFrame], Mapping[str, Column]]


@dataclass(frozen=True)
class TableOf:
    """How a table is made.

    Attributes:
        name: stem of its files.
        make: from the frame of the experiments to the values of the table; None where it has none.
        of: the experiments whose lines it takes.
        title, note: may hold ``{frames}`` and ``{machine}``.
        columns: how columns are shown; or a function of the values.
        shown: names of the columns that are shown; or a function of the values.
        folded, key: as :class:`Table` has them.
        commands: what makes it again; those of the records if there are none here.
    """

    name: str
    make: Callable[[pd.DataFrame], pd.DataFrame | None]
    of: Of
    title: Text
    note: Text = ""
    columns: Columns = field(default_factory=dict)
    shown: Sequence[str] | Callable[[pd.DataFrame], Sequence[str]] = ()
    folded: bool = False
    key: Sequence[str] = ()
    commands: Sequence[str] = ()

    def tables(self, frame: pd.DataFrame) -> Iterator[Table]:
        """The table, if it has lines."""
        data = self.make(frame)
        if data is None or not len(data):
            return
        columns = self.columns(data) if callable(self.columns) else self.columns
        shown = self.shown(data) if callable(self.shown) else self.shown
        yield Table(
            self.name,
            _text(self.title, frame),
            data,
            tuple(shown),
            dict(columns),
            _text(self.note, frame),
            _commands(self.commands, frame),
            self.folded,
            self.key,
        )


@dataclass(frozen=True)
class FigureOf:
    """How a figure is drawn.

    Attributes:
        name: stem of its file.
        draw: takes a matplotlib figure and the frame.
        of: the experiments whose lines it takes.
        caption: what it shows; also the alternative text; may hold ``{frames}``.
        size: width and height in inches.
        kind: ``svg``, or ``webp`` for a figure made of pixels.
        needs: whether there is anything to draw.
        commands: what makes it again; those of the records if there are none here.
    """

    name: str
    draw: Callable[[Figure, pd.DataFrame], None]
    of: Of
    caption: Text
    size: tuple[float, float] = (WIDTH, 2.6)
    kind: str = "svg"
    needs: Callable[[pd.DataFrame], bool] = lambda frame: bool(len(frame))
    commands: Sequence[str] = ()

    def plots(self, frame: pd.DataFrame) -> Iterator[Plot]:
        """The figure, not yet drawn, if there is anything to draw."""
        if self.needs(frame):
            caption = _text(self.caption, frame)
            commands = _commands(self.commands, frame)
            yield Plot(self, caption, commands, frame)


@dataclass(frozen=True)
class NumbersOf:
    """How numbers are made that the paper gives, too: of the experiments' own frames alone."""

    make: Callable[[pd.DataFrame], Iterator[Quantity]]
    of: Of

    @property
    def name(self) -> str:
        """For messages."""
        return "its numbers"

    def quantities(self, frame: pd.DataFrame) -> Iterator[Quantity]:
        """The numbers, if there are lines."""
        own = frame[~frame.elsewhere.astype(bool)]
        if len(own):
            yield from self.make(own)


@dataclass(frozen=True)
class Plot:
    """A figure that is drawn when it is needed.

    Attributes:
        of: how it is drawn.
        caption: also used as alternative text.
        commands: make its results again.
        frame: what it is drawn from.
    """

    of: FigureOf
    caption: str
    commands: Sequence[str]
    frame: pd.DataFrame

    @property
    def name(self) -> str:
        """Stem of its file, and its anchor on the page."""
        return self.of.name

    @property
    def kind(self) -> str:
        """Ending of its file."""
        return self.of.kind

    def draw(self) -> Figure:
        """The matplotlib figure."""
        from experiments.reporting.plot import STYLE, plt  # --help need not wait for it

        with plt.rc_context(fname=STYLE):
            figure = plt.figure(figsize=self.of.size, layout="constrained")
            self.of.draw(figure, self.frame)
        return figure


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
    tables: Sequence[TableOf] = ()
    figures: Sequence[FigureOf] = ()
    numbers: Sequence[NumbersOf] = ()

    def tables_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Table]:
        """Its tables of these results.

        Args:
            results: records.
            failures: takes what fails, so that the others are made all the same; None raises it.
        """
        for table in self.tables:
            yield from self._answers("table", table, table.tables, results, failures)

    def plots_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Plot]:
        """Its figures of these results, not yet drawn; `failures` as :meth:`tables_of`."""
        for figure in self.figures:
            yield from self._answers("figure", figure, figure.plots, results, failures)

    def quantities_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Quantity]:
        """Its numbers of these results; `failures` as :meth:`tables_of`."""
        for numbers in self.numbers:
            yield from self._answers(
                "numbers", numbers, numbers.quantities, results, failures
            )

    def _answers(
        self,
        kind: str,
        asked: TableOf | FigureOf | NumbersOf,
        answer: Callable[[pd.DataFrame], Iterator[Any]],
        results: Results,
        failures: list[Failure] | None,
    ) -> Iterator[Any]:
        """What a function says of the lines that it takes; nothing where there are none."""
        try:
            frame = results.frame(*_names(asked.of))
            if len(frame):
                yield from answer(frame)
        except Exception as error:
            if failures is None:
                raise
            failures.append(Failure(self.name, f"{kind} {asked.name}", error))


@dataclass(frozen=True)
class Failure:
    """A table, figure or number of a study that could not be made, and why."""

    study: str
    called: str
    error: Exception

    def __str__(self) -> str:
        """One line."""
        words = " ".join(str(self.error).split())
        kind = type(self.error).__name__
        return f"study {self.study} failed at {self.called}: {kind}: {words}"


def _names(of: Of) -> tuple[str, ...]:
    return (of,) if isinstance(of, str) else tuple(of)


def _text(text: Text, frame: pd.DataFrame) -> str:
    """A text with the frames and the machine of the records put in."""
    words = text(frame) if callable(text) else text
    if "{frames}" in words:
        words = words.replace("{frames}", frames_of(frame.to_dict("records")))
    if "{machine}" in words:
        words = words.replace("{machine}", _machine(frame.iloc[0]))
    return words


def _machine(line: pd.Series) -> str:
    parts = [str(line.cpu), counted(int(line.threads), "thread")]
    if line.device not in (None, "cpu"):
        parts.insert(0, str(line.device))
    return ", ".join(parts)


def _commands(given: Sequence[str], frame: pd.DataFrame) -> tuple[str, ...]:
    """Those given, else those that made the records, each once."""
    return tuple(given) or tuple(dict.fromkeys(frame.command))


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
