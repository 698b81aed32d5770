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
from experiments.reporting.trained import MACHINE, extra_models, learning
from experiments.studies.table1 import tables
from experiments.studies.table1.tables import BESIDE_HDC, DESCENT, OF, on_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


def beside() -> tuple[str, ...]:
    """Models that stand in the CSV and are not drawn."""
    return (*configs.models("fast"), DESCENT)


def error_vs_time(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Test error against training time relative to HDC: a row per report of a run, and one per
    model at the end of training; ``reached`` marks the report at which training accuracy passed
    90 %. Models: the paper's, HDC first, fast ones, one's own."""
    runs = on_scene(of_experiment(frame, RUNS))
    names = [*configs.models("paper"), *beside(), *extra_models(runs, tables.scene())]
    timed = runs[runs.model.isin(names)].assign(hdc_s=hdc_seconds(runs))
    timed = timed.dropna(subset="hdc_s").set_index("record", drop=False)
    if "hdc" not in set(timed.model):
        return None
    every = learning(frame[frame.record.isin(timed.record)])
    ratios = (timed.total_time_s / timed.hdc_s).groupby(timed.model).median()
    never = np.isinf(timed.groupby("model").training_time_s.median())
    relative = every.seconds / every.record.map(timed.hdc_s)
    is_end = every["at"] == "end"
    every = every.assign(
        time=relative.where(~is_end, every.model.map(ratios)),
        reached=_reached(every, timed),
        origin=configs.scene_display(tables.scene())["kind"],
    )
    every = every[~(is_end & every.model.map(never))]
    every = every.sort_values(
        "model", key=lambda model: model.map(names.index), kind="stable"
    )
    return every.drop(columns=[*ROW[2:], "seconds"])


def _reached(every: pd.DataFrame, timed: pd.DataFrame) -> pd.Series:
    """Whether a report is the one nearest to the time at which training accuracy passed 90 %."""
    distance = (every.seconds - every.record.map(timed.training_time_s)).abs()
    nearest = distance == distance.groupby(every.record).transform("min")
    return nearest & np.isfinite(distance)


def hdc_seconds(runs: pd.DataFrame) -> pd.Series:
    """The training time of HDC that each run's is relative to: of HDC that was trained just before
    and just after it; where none was, of HDC's own run of the same seed on the same machine."""
    alike = ["seeds", *MACHINE]
    of_hdc = runs[runs.model == "hdc"].set_index(alike).total_time_s
    own = runs[alike].apply(tuple, axis="columns").map(of_hdc)
    return runs[BESIDE_HDC].fillna(own) if BESIDE_HDC in runs else own


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
