"""Error against run time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import ROW, RUNS, of_experiment
from experiments.reporting.facets import error_axis, learning_curves
from experiments.reporting.plot import (
    PAPER,
    entry,
    handle,
    legend_below,
    look_of,
    plain_decades,
    published_point,
)
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import Table
from experiments.reporting.trained import extra_models, learning
from experiments.studies.table1 import tables
from experiments.studies.table1.tables import DESCENT, OF, on_scene, with_hdc_seconds

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


def beside() -> tuple[str, ...]:
    """Models that stand in the CSV and are not drawn."""
    return (*configs.models("fast"), DESCENT)


def error_vs_time(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Test error against training time relative to HDC: a row per report of a run, and one per
    model at the end of training; ``reached`` marks the report at which training accuracy passed
    90 %. Models: the paper's, HDC first, fast ones, one's own."""
    timed = with_hdc_seconds(on_scene(of_experiment(frame, RUNS)))
    timed = timed.dropna(subset="hdc_s").set_index("record", drop=False)
    names = [*configs.models("paper"), *beside(), *extra_models(timed, tables.scene())]
    timed = timed[timed.model.isin(names)]
    if "hdc" not in set(timed.model):
        return None
    every = learning(frame[frame.record.isin(timed.record)])
    is_end = every["at"] == "end"
    by_model = timed.groupby("model")
    ends = (timed.total_time_s / timed.hdc_s).groupby(timed.model).median()
    every["time"] = (every.seconds / every.record.map(timed.hdc_s)).where(
        ~is_end, every.model.map(ends)
    )
    every["reached"] = _reached(every, timed)
    never = np.isinf(by_model.training_time_s.median())
    every = every[~(is_end & every.model.map(never))]
    every = every.sort_values(
        "model", key=lambda model: model.map(names.index), kind="stable"
    )
    kind = configs.scene_display(tables.scene())["kind"]
    return every.drop(columns=[*ROW[2:], "seconds"]).assign(origin=kind)


def _reached(every: pd.DataFrame, timed: pd.DataFrame) -> pd.Series:
    """Whether a report is the one nearest to the time at which training accuracy passed 90 %."""
    passed = every.record.map(timed.training_time_s)
    distance = (every.seconds - passed).abs()
    nearest = distance == distance.groupby(every.record).transform("min")
    return nearest & np.isfinite(distance)


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """The paper's models and one's own, with a marker where training accuracy passed 90 %, and the
    paper's points."""
    axes = figure.subplots()
    floor = error_axis(axes, data.n_test.max())
    shown = data[~data.model.isin(beside())]
    learning_curves(axes, shown, "time", floor)
    for row in shown[shown.reached].itertuples():
        look = look_of(str(row.model)) | {"ls": "", "ms": 5, "alpha": 0.75}
        axes.plot(row.time, max(row.error, floor), **look)
    for model in tables.PAPER:
        known = tables.papers_numbers(model)
        error = max(1 - known["published_test_accuracy"], floor)
        time = known["published_training_time_over_hdc"]
        published_point(axes, model, time, error, 9)
    axes.set(xscale="log", xlabel="training time relative to HDC", ylabel="test error")
    plain_decades(axes)
    own = [model for model in shown.model.unique() if model not in tables.PAPER]
    named = [model for model in (*tables.PAPER, *own) if model in set(shown.model)]
    mark = entry(
        "mark on a curve: training\naccuracy exceeds 90 %", color="0.5", marker="o"
    )
    entries = [handle(model, 28) for model in named]
    legend_below(figure, [*entries, mark, entry("paper", **PAPER)])


FIGURE = Figure(
    "error_vs_time",
    Table(
        "error_vs_time",
        error_vs_time,
        of=OF,
        commands=[f"{RUN}table1", f"{RUN}table1_extended"],
    ),
    draw,
    title="Test error against training time",
    caption="Test error against training time relative to HDC (Table I): one curve "
    "per model and seed, with a marker where training accuracy exceeds 90 %; the CSV has other "
    "models, too. Bars: 95 %, after full training. Grey strip: no test frame is wrong. "
    "Stars: the paper.",
    size=(3.4, 3.3),
)
