"""Error against run time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import ROW, RUNS, of_experiment
from experiments.reporting.facets import error_axis, learning_curves
from experiments.reporting.plot import (
    by_panel,
    handle,
    look_of,
    plain_decades,
    published_point,
)
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import Table
from experiments.reporting.trained import extra_models, learning
from experiments.studies.table1 import models
from experiments.studies.table1.tables import OF, on_scene, with_hdc_seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_LEGEND_WIDTH = 22  # characters of a name on one line


def error_vs_time(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Test error against training time relative to HDC: a row per report of a run, and one per
    model at the end of training; ``reached`` marks the report at which training accuracy passed
    90 %. Models: the paper's, HDC first, fast ones, one's own."""
    scene = models.scene()
    timed = with_hdc_seconds(on_scene(of_experiment(frame, RUNS)))
    timed = timed.dropna(subset="hdc_s").set_index("record", drop=False)
    names = [*configs.models("paper"), *configs.models("fast"), models.DESCENT]
    names += extra_models(timed, scene)
    timed = timed[timed.model.isin(names)]
    if "hdc" not in set(timed.model):
        return None
    every = learning(frame[frame.record.isin(timed.record)])
    every["time"] = every.seconds / every.record.map(timed.hdc_s)
    every["reached"] = _reached(every, timed)
    is_end = every["at"] == "end"
    by_model = (timed.total_time_s / timed.hdc_s).groupby(timed.model).median()
    every.loc[is_end, "time"] = every.model[is_end].map(by_model)
    never = np.isinf(timed.training_time_s.groupby(timed.model).median())
    every = every[~(is_end & every.model.map(never))]
    order = {name: place for place, name in enumerate(names)}
    every = every.sort_values("model", key=lambda name: name.map(order), kind="stable")
    kind = configs.scene_display(scene)["kind"]
    return every.drop(columns=[*ROW[2:], "seconds"]).assign(origin=kind)


def _reached(every: pd.DataFrame, timed: pd.DataFrame) -> pd.Series:
    """Whether a report is the one nearest to the time at which training accuracy passed 90 %."""
    passed = every.record.map(timed.training_time_s)
    distance = (every.seconds - passed).abs()
    nearest = distance == distance.groupby(every.record).transform("min")
    return nearest & np.isfinite(distance)


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """Panels of a few models each, the first with the paper's points."""
    shown = by_panel(list(data.model.unique()))
    figure.set_size_inches(3.4, 0.8 + 2.3 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, names in zip(panels, shown, strict=True):
        floor = error_axis(axes, data.n_test.max())
        axes.set_xscale("log")
        rows = data[data.model.isin(names)]
        learning_curves(axes, rows, "time", floor)
        _mark(axes, rows[rows.reached], floor)
        axes.set_ylabel("test error")
        handles = [handle(name, _LEGEND_WIDTH) for name in names]
        place = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 2}
        axes.legend(handles=handles, **place)
    for model in models.PAPER:
        known = models.papers_numbers(model)
        error = max(1 - known["published_test_accuracy"], floor)
        time = known["published_training_time_over_hdc"]
        published_point(panels[0], model, time, error, 9)
    panels[-1].set_xlabel("training time relative to HDC")
    plain_decades(panels[-1])


def _mark(axes: Axes, rows: pd.DataFrame, floor: float) -> None:
    """A marker where training accuracy passed 90 %."""
    for row in rows.itertuples():
        look = look_of(str(row.model)) | {"ls": "", "ms": 5, "alpha": 0.75}
        axes.plot(row.time, max(row.error, floor), **look)


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
    "per model and seed, with a marker where training accuracy exceeds 90 %. "
    "Bars: 95 %, after full training. Grey: no error. Stars: the paper.",
    size=(3.4, 5.4),
)
