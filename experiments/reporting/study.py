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
import pkgutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

import pandas as pd

from experiments.records import configs
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


class Quantity(NamedTuple):
    """A number that the paper gives, too.

    Attributes:
        name: ``experiment/quantity`` of published.csv.
        estimate: the number, a share as a fraction, and the 95 % interval of one more sensor's.
        n, seeds: how many test samples, or frames, of all seeds; how many seeds.
        note: what a reader has to know.
    """

    name: str
    estimate: Estimate
    n: int
    seeds: int | None = None
    note: str = ""


@dataclass(frozen=True)
class Study:
    """One question.

    Attributes:
        name: its folder.
        title: heading on the page.
        question: a sentence or two.
        order: place on the page; smaller comes first.
        front: whether it stands unfolded on the page, before the others.
        tables, figures: what answers it, in the order in which they are shown.
        numbers: by experiment, what makes numbers that the paper gives, too, of lines on the
            experiment's own frames.
    """

    name: str
    title: str
    question: str
    order: float
    front: bool = False
    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    numbers: Mapping[str, Callable[[pd.DataFrame], Iterable[Quantity]]] = field(
        default_factory=dict
    )


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
