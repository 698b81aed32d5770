"""A study: a question, and functions of records that answer it as tables, figures and numbers.

A study is a folder of ``experiments/studies`` with a module ``view`` that has a ``STUDY``, whose
functions are registered with decorators::

    STUDY = Study("drift", "Drift and recalibration", "How many new samples …?", order=5)

    @STUDY.table("drift_updates", of="drift", title="Accuracy after recalibration, {frames}")
    def updates(rows, config):
        return rows.groupby(["model", "method"])...
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import ModuleType
from typing import Any

from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.estimates import Estimate
from experiments.reporting.sources import Of, Source, sources, with_places
from experiments.reporting.table import Table

RUN = "python -m experiments.run experiment="
WIDTH = 3.4  # in, one column of a journal
__all__ = [
    "Failure",
    "Plot",
    "Quantity",
    "Study",
    "own_studies",
    "studies",
    "with_places",
]
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


@dataclass(frozen=True)
class Plot:
    """A figure that is drawn when it is needed.

    Attributes:
        name: stem of its file, and its anchor on the page.
        caption: also used as alternative text.
        draw: makes the matplotlib figure.
        commands: make its results again.
        kind: ``svg``, or ``webp`` for a figure made of pixels.
        chart: its interactive form for the page, as Vega-Lite; None if it has none.
        behind: whether other results have anything to draw behind it; None if it is never drawn
            over others.
    """

    name: str
    caption: str
    draw: Callable[..., Any]
    commands: Sequence[str] = ()
    kind: str = "svg"
    chart: Callable[[], dict[str, Any]] | None = None
    behind: Callable[[Results], bool] | None = None

    def over(self, behind: Results | None) -> Plot:
        """The figure over other results, which its caption names where there are any to draw."""
        if behind is None or self.behind is None or not self.behind(behind):
            return self
        caption = f"{self.caption} Pale: the reference."
        return replace(self, caption=caption, draw=partial(self.draw, behind=behind))


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


@dataclass
class Study:
    """One question.

    Attributes:
        name: its folder.
        title: heading on the page.
        question: a sentence or two.
        order: place on the page; smaller comes first.
        front: whether it stands unfolded on the page, before the others.
    """

    name: str
    title: str
    question: str
    order: float
    front: bool = False
    _makers: list[_Maker] = field(default_factory=list)

    def table(
        self,
        name: str,
        *,
        title: str,
        of: Of = None,
        note: str = "",
        shown: Sequence[str] = (),
        columns: Mapping[str, Column] | None = None,
        folded: bool = False,
        commands: Sequence[str] = (),
        key: Sequence[str] = (),
    ) -> Decorator:
        """Register a function that gives the data frame of a table, or None where it has none.

        Its ``attrs`` may hold ``title``, ``note``, ``shown``, ``columns``, ``commands`` of its own.

        Args:
            name: stem of its files; a measurement on other frames than the experiment's adds a
                suffix.
            title, note: may hold ``{frames}`` and ``{machine}`` of the measurement.
            of: name of the measurement, or of several on the same frames, whose rows the function
                takes, followed by the config of the first; None for a function of the results.
            shown, columns, folded, commands, key: as :class:`Table` has them.
        """

        def make(source: Source, function: Callable[..., Any]) -> Iterator[Table]:
            data = function(*source.arguments)
            if data is None or not len(data):
                return
            texts: dict[str, Any] = {
                "title": title,
                "note": note,
                "shown": shown,
                "columns": columns or {},
                **data.attrs,
            }
            yield Table(
                f"{name}{source.suffix}",
                source.fill(texts["title"]),
                data,
                tuple(texts["shown"]),
                texts["columns"],
                source.fill(texts["note"]),
                tuple(texts.get("commands", ())) or tuple(commands) or source.commands,
                folded,
                key,
            )

        return self._registering(Table, f"table {name}", of, make)

    def figure(
        self,
        name: str,
        *,
        caption: str | Callable[..., str],
        of: Of = None,
        size: tuple[float, float] = (WIDTH, 2.6),
        kind: str = "svg",
        needs: Callable[..., bool] = lambda *_: True,
        commands: Sequence[str] | Callable[..., Sequence[str]] = (),
        over: bool = False,
        chart: Callable[..., dict[str, Any]] | None = None,
    ) -> Decorator:
        """Register a function that draws on a figure, whose first argument that is.

        Args:
            name, of: as :meth:`table`.
            commands: as :meth:`table`, or a function of the function's other arguments.
            caption: what it shows, a text or a function of the function's other arguments; also
                the alternative text; may hold ``{frames}``.
            size: width and height in inches.
            kind: as :class:`Plot` has it.
            needs: of the function's other arguments: whether there is anything to draw.
            over: whether the function takes ``behind``, other results that are drawn behind, or
                None.
            chart: of the function's other arguments: the figure's interactive form, Vega-Lite.
        """

        def make(source: Source, function: Callable[..., Any]) -> Iterator[Plot]:
            if needs(*source.arguments):
                draw = partial(_draw, function, source.arguments, size, over)
                says = caption(*source.arguments) if callable(caption) else caption
                made = commands(*source.arguments) if callable(commands) else commands
                yield Plot(
                    f"{name}{source.suffix}",
                    source.fill(says),
                    draw,
                    tuple(made) or source.commands,
                    kind,
                    chart and partial(chart, *source.arguments),
                    needs if over else None,
                )

        return self._registering(Plot, f"figure {name}", of, make)

    def quantities(self, *, of: Of = None) -> Decorator:
        """Register a generator of :class:`Quantity`; of measurements on their own frames only."""

        def make(source: Source, function: Callable[..., Any]) -> Iterator[Quantity]:
            if not source.suffix:
                yield from function(*source.arguments)

        return self._registering(Quantity, "its numbers", of, make)

    def tables_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Table]:
        """Its tables of these results.

        Args:
            results: records.
            failures: takes what fails, so that the others are made all the same; None raises it.
        """
        return self._answers(Table, results, failures)

    def plots_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Plot]:
        """Its figures of these results, not yet drawn; `failures` as :meth:`tables_of`."""
        return self._answers(Plot, results, failures)

    def quantities_of(
        self, results: Results, failures: list[Failure] | None = None
    ) -> Iterator[Quantity]:
        """Its numbers of these results; `failures` as :meth:`tables_of`."""
        return self._answers(Quantity, results, failures)

    def _answers(
        self,
        kind: type,
        results: Results,
        failures: list[Failure] | None,
    ) -> Iterator[Any]:
        for maker in self._makers:
            if maker.kind is not kind:
                continue
            for source in sources(results, maker.of):
                try:
                    yield from maker.make(source, maker.function)
                except Exception as error:
                    if failures is None:
                        raise
                    failures.append(Failure(self.name, maker.called, error))

    def _registering(
        self,
        kind: type,
        called: str,
        of: Of,
        make: Callable[..., Iterator[Any]],
    ) -> Decorator:
        def register(function: Callable[..., Any]) -> Callable[..., Any]:
            self._makers.append(_Maker(kind, called, of, make, function))
            return function

        return register


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


@dataclass(frozen=True)
class _Maker:
    """A registered function: what it gives, what that is called, the measurements it takes."""

    kind: type
    called: str
    of: Of
    make: Callable[..., Iterator[Any]]
    function: Callable[..., Any]


def _draw(
    function: Callable[..., Any],
    arguments: tuple[Any, ...],
    size: tuple[float, float],
    over: bool,
    behind: Results | None = None,
) -> Any:
    from experiments.reporting.plot import STYLE, plt  # --help need not wait for it

    keywords = {"behind": behind} if over else {}
    with plt.rc_context(fname=STYLE):
        figure = plt.figure(figsize=size, layout="constrained")
        function(figure, *arguments, **keywords)
    return figure


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
    tasks = {measured.record.task for measured in results.measurements}
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
