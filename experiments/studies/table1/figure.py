"""Error against run time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.records.results import CHECKPOINTS, RUNS, of_experiment
from experiments.reporting.plot import (
    PAPER,
    entry,
    handle,
    legend_below,
    look_of,
    plain_decades,
    published_look,
)
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import Table
from experiments.reporting.trained import extra_models, split_of
from experiments.studies.table1 import tables
from experiments.studies.table1.tables import BESIDE_HDC, OF, on_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

COLUMNS = ["record", "seed", "time", "error", "at"]


def error_vs_time(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Test error against training time relative to HDC that was trained just before and just after:
    a row per report of a run, and one ``at`` the time when training accuracy passed 90 %. Models:
    the paper's, HDC first, and one's own."""
    runs = on_scene(of_experiment(frame, RUNS))
    names = [*tables.PAPER, *extra_models(runs, tables.scene())]
    runs = runs[runs.model.isin(names)]
    if "hdc" not in set(runs.model):
        return None
    own = runs.total_time_s.where(runs.model == "hdc")
    hdc_s = runs[BESIDE_HDC].fillna(own) if BESIDE_HDC in runs else own
    passed = runs.assign(
        training_s=runs.training_time_s.where(np.isfinite(runs.training_time_s)),
        test_accuracy=runs.test_accuracy_at_target,
        at="90 % in training",
    )
    reports = of_experiment(frame, CHECKPOINTS).assign(at="report")
    every = pd.concat([reports[reports.record.isin(runs.record)], passed])
    every["time"] = every.training_s / every.record.map(hdc_s.set_axis(runs.record))
    every["error"] = 1 - every.test_accuracy
    every = every.dropna(subset=["time", "error"])
    return pd.concat(
        every.loc[every.model == name, COLUMNS].assign(model=name) for name in names
    ).assign(
        scene=tables.scene(), split=split_of(runs), n_test=int(runs.n_test.iloc[0])
    )


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A line per run, with a marker where training accuracy passed 90 %, and the paper's points."""
    axes = figure.subplots()
    for (model, at, _), rows in data.groupby(["model", "at", "record"], sort=False):
        look: Any = look_of(str(model)) | {"lw": 0.8, "alpha": 0.75}
        look |= {"marker": ""} if at == "report" else {"ls": "", "ms": 5}
        axes.plot(rows.time, rows.error, **look)
    for model in tables.PAPER:
        known = tables.papers_numbers(model)
        error = 1 - known["published_test_accuracy"]
        time = known["published_training_time_over_hdc"]
        axes.plot(time, error, zorder=5, **published_look(model))
    least = 1 / data.n_test.iloc[0]  # below it an error is none: the axis is linear
    axes.set(xscale="log", xlabel="training time relative to HDC", ylabel="test error")
    axes.set_yscale("symlog", linthresh=least)
    axes.set_ylim(-0.2 * least, 1.1)
    axes.yaxis.set_major_formatter(lambda y, _: f"{100 * y:g} %")
    plain_decades(axes)
    mark = entry(
        "mark on a curve: training\naccuracy exceeds 90 %", color="0.5", marker="o"
    )
    entries = [handle(model, 28) for model in data.model.unique()]
    legend_below(figure, [*entries, mark, entry("paper", **PAPER)])


FIGURE = Figure(
    "error_vs_time",
    Table(
        "error_vs_time",
        error_vs_time,
        of=OF,
        commands=[f"{RUN}table1"],
    ),
    draw,
    title="Test error against training time",
    caption="Test error against training time relative to HDC (Table I): one curve "
    "per model and seed, with a marker where training accuracy exceeds 90 %. Below one wrong test "
    "frame the axis is linear. Stars: the paper.",
    size=(3.4, 3.3),
)
