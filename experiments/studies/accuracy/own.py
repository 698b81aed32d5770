"""Runs that were started by hand, on any scene: accuracy against N, and error against time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records.results import CHECKPOINTS, ROW, RUNS
from experiments.reporting.columns import scene_name
from experiments.reporting.facets import error_axis, facets, learning_curves
from experiments.reporting.plot import (
    LETTERS,
    handle,
    legend_below,
    panel,
    plain_decades,
    wrapped,
)
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.trained import learning, of_runs

if TYPE_CHECKING:
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
    data = _first(data).sort_values("n_train", kind="stable")
    place: Any = {"hue": "model", "row": "scene", "sharex": True, "scale": 100}
    panels = facets(figure, data, "n_train", "test_accuracy_final", **place)
    for axes in panels.values():
        axes.set(xscale="log", ylabel="test accuracy (%)", xlabel="training samples N")
    _finish(figure, data)
    sizes = sorted(data.n_train.unique())
    figure.axes[0].set_xticks(sizes, map(str, sizes))


def draw_errors(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene, a line per run, a marker after training."""
    data = _first(data)
    scenes = data.scene.unique()
    panels = figure.subplots(len(scenes), 1, squeeze=False, sharex=True)[:, 0]
    for axes, scene in zip(panels, scenes, strict=True):
        rows = data[data.scene == scene]
        floor = error_axis(axes, rows.n_test.max())
        axes.set(xscale="log", xlabel="training time (s)", ylabel="test error")
        learning_curves(axes, rows, "seconds", floor)
    _finish(figure, data)


def _first(data: pd.DataFrame) -> pd.DataFrame:
    """The rows of as many scenes as a figure has room for."""
    return data[data.scene.isin(data.scene.unique()[:PANELS])]


def _finish(figure: Canvas, data: pd.DataFrame) -> None:
    """The names of scenes, at least a decade of the shared axis, and a legend below."""
    scenes = list(data.scene.unique())
    for axes, letter, scene in zip(figure.axes, LETTERS, scenes, strict=False):
        panel(axes, letter, wrapped(scene_name(scene), 40))
    low, high = figure.axes[0].get_xlim()
    figure.axes[0].set_xlim(min(low, high / 10), high)
    figure.axes[0].xaxis.set_minor_formatter("")
    plain_decades(figure.axes[0])
    models = list(data.model.unique())
    figure.set_size_inches(3.4, 0.6 + 2 * len(scenes) + 0.08 * len(models))
    legend_below(figure, map(handle, models))


def _more(data: pd.DataFrame) -> str:
    """What the bars are, and how many scenes have no panel."""
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
