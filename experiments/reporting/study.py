"""A study: a question, and what answers it: tables, figures of tables, and numbers of the paper.

A study is a folder of ``experiments/studies``, or a module of one's own, that has a ``STUDY``::

    def by_model(frame):
        return frame.groupby(["scene", "model"], as_index=False).error.mean()

    ERRORS = Table("errors", by_model, of="my_experiment", key=("scene", "model"))
    STUDY = Study(
        "mine",
        "Errors",
        "Which model errs least?",
        order=20,
        tables=[ERRORS],
        figures=[Figure("errors", ERRORS, draw, title="Errors", caption="Error by model.")],
    )

A table takes the lines of :meth:`experiments.records.results.Results.frame` of the experiments that
it names. A figure draws the values of one table and nothing else.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records import configs
from experiments.records.results import own_frames
from experiments.reporting.columns import scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.plot import STYLE, head, literal, save
from experiments.reporting.table import RUN as RUN
from experiments.reporting.table import Table, Text, text_for
from experiments.reporting.text import frames_of

if TYPE_CHECKING:  # matplotlib is slow to load
    from matplotlib.figure import Figure as Canvas

WIDTH = 3.4  # in, one column of a journal
MOST_NAMES = 2  # of scenes below a title; with more, each panel has its own


def about(data: pd.DataFrame) -> str:
    """Scenes, frames, split and number of seeds of a table, as far as its columns have them."""
    parts: list[str] = []
    if "scene" in data:
        scenes = [str(scene) for scene in data.scene.unique()]
        names = map(scene_name, scenes)
        parts += names if len(scenes) <= MOST_NAMES else []
        parts.append(
            frames_of(configs.scene_display(scene)["kind"] for scene in scenes)
        )
    if "split" in data:
        parts += map(str, data.split.dropna().unique())
    if "seeds" in data:
        counts = sorted({int(count) for count in data.seeds if count})
        ends = "–".join(map(str, dict.fromkeys((*counts[:1], *counts[-1:]))))
        parts.append("1 seed" if ends == "1" else f"{ends} seeds")
    return ", ".join(dict.fromkeys(filter(None, parts)))


@dataclass(frozen=True)
class Figure:
    """A figure of a table; it is drawn when it is needed.

    Attributes:
        name: stem of its file, and its anchor on the page.
        table: whose values it draws. If the study does not show the table, its CSV lies beside the
            figure.
        draws: takes a matplotlib figure and the values.
        title: above the figure; or a function of the values.
        caption: what it shows; also the alternative text.
        details: below the title, what it is of; or a function of the values.
        size: width and height in inches.
    """

    name: str
    table: Table
    draws: Callable[[Canvas, pd.DataFrame], None]
    caption: str
    title: Text = ""
    details: Text = about
    size: tuple[float, float] = (WIDTH, 2.6)

    def draw(self, data: pd.DataFrame) -> Canvas:
        """The matplotlib figure of some values."""
        from matplotlib import rc_context
        from matplotlib.figure import Figure as Canvas

        with rc_context(fname=STYLE):
            figure = Canvas(figsize=self.size, layout="constrained")
            self.draws(figure, data)
            texts = (self.title, self.details)
            title, details = (text_for(text, data) for text in texts)
            if title:
                head(figure, title, literal(details[:1].upper() + details[1:]))
        return figure

    def file(self) -> bytes:
        """The content of its file, an SVG."""
        return save(self.draw(self.table.data))


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
class Numbers:
    """How numbers are made that the paper gives, too: of the experiments' own frames alone."""

    make: Callable[[pd.DataFrame], Iterator[Quantity]]
    of: Sequence[str]

    def made(self, frame: pd.DataFrame) -> list[Quantity]:
        """The numbers, if there are lines."""
        own = own_frames(frame)
        return list(self.make(own)) if len(own) else []


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
    figures: Sequence[Figure] = ()
    numbers: Sequence[Numbers] = ()


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


def own_study(module: str) -> Study:
    """The study of a user's own module.

    Raises:
        ValueError: the module cannot be imported, or has no ``STUDY``.
    """
    try:
        found = importlib.import_module(module)
    except ImportError as error:
        raise ValueError(f"--study {module}: {error}; set PYTHONPATH") from None
    if not hasattr(found, "STUDY"):
        raise ValueError(f"--study {module}: expected a name STUDY in it, found none")
    study: Study = found.STUDY
    return study
