"""Runs that were started by hand, on any scene: accuracy against N, and error against time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pandas as pd

from experiments.records.results import CHECKPOINTS, ROW, RUNS
from experiments.reporting.columns import scene_name
from experiments.reporting.facets import error_axis, learning_curves, line
from experiments.reporting.plot import (
    LETTERS,
    handle,
    legend_below,
    look_of,
    panel,
    plain_decades,
    wrapped,
)
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.trained import learning, of_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

PANELS = 6  # scenes of a figure at most


def started(frame: pd.DataFrame) -> pd.DataFrame:
    """The lines of runs on all pixels that no experiment started, and of their checkpoints."""
    by_hand = frame["sweep"].eq("") & frame.asked_d.eq(0)
    names = frame.record[by_hand]
    return frame[frame.record.isin(names)]


def accuracy_vs_n(runs: pd.DataFrame) -> pd.DataFrame | None:
    """Rows of scenes on which a model was trained on several numbers of samples."""
    own = started(runs)
    if not len(own):
        return None
    table = of_runs(own)
    several = table.groupby("scene").filter(lambda rows: rows.model.duplicated().any())
    return several.drop(columns=ROW[2:])


def error_vs_time(frame: pd.DataFrame) -> pd.DataFrame | None:
    """The error wherever a run was tested, and after training, with the most training samples."""
    own = started(frame)
    if not len(own):
        return None
    sizes = own.asked_n.where(own.asked_n > 0, float("inf"))
    most = sizes == sizes.groupby(own.scene).transform("max")
    return learning(own[most])


def draw_accuracies(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene, a line per model."""
    sizes: set[int] = set()
    for axes, rows in _panels(figure, data, "training samples N", "test accuracy (%)"):
        sizes.update(rows.n_train)
        ordered = rows.sort_values("n_train", kind="stable")
        for model, points in ordered.groupby("model", sort=False):
            look = look_of(str(model))
            line(axes, points, "n_train", "test_accuracy_final", 100, **look)
    figure.axes[0].set_xticks(sorted(sizes), map(str, sorted(sizes)))


def draw_errors(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene, a line per run, a marker after training."""
    for axes, rows in _panels(figure, data, "training time (s)", "test error"):
        learning_curves(axes, rows, "seconds", error_axis(axes, rows.n_test.max()))


def _panels(
    figure: Canvas, data: pd.DataFrame, x: str, y: str
) -> Iterator[tuple[Axes, pd.DataFrame]]:
    """A panel and the rows of each scene, of as many as a figure has room for; when they are drawn
    at least a decade of the shared axis, and a legend below."""
    scenes, models = data.scene.unique()[:PANELS], data.model.unique()
    figure.set_size_inches(3.4, 0.6 + 2 * len(scenes) + 0.08 * len(models))
    panels = figure.subplots(len(scenes), 1, squeeze=False, sharex=True)[:, 0]
    for axes, letter, scene in zip(panels, LETTERS, scenes, strict=False):
        axes.set(xscale="log", xlabel=x, ylabel=y)
        yield axes, data[data.scene == scene]
        panel(axes, letter, wrapped(scene_name(scene), 40))
    low, high = panels[0].get_xlim()
    panels[0].set_xlim(min(low, high / 10), high)
    panels[0].xaxis.set_minor_formatter("")
    plain_decades(panels[0])
    legend_below(figure, map(handle, models))


def _more(data: pd.DataFrame) -> str:
    """The kind of error bars, and the number of scenes without a panel."""
    left_out = data.scene.nunique() - PANELS
    text = "95 % intervals"
    return f"{text}; {left_out} more scenes: see the CSV" if left_out > 0 else text


FIGURES = [
    Figure(
        "own_accuracy_vs_n",
        Table("own_accuracy_vs_n", accuracy_vs_n, of=RUNS),
        draw_accuracies,
        title="Test accuracy against training samples",
        details=_more,
        caption="Test accuracy against the number of training samples, of runs that were "
        "started by hand: a panel per scene.",
    ),
    Figure(
        "own_error_vs_time",
        Table("own_error_vs_time", error_vs_time, of=(RUNS, CHECKPOINTS)),
        draw_errors,
        title="Test error against training time",
        details=_more,
        caption="Test error against training time, of runs that were started by hand: a panel "
        "per scene. Lines: while the model learns; markers: after training, with 95 % intervals. "
        "Grey: no error.",
    ),
]
