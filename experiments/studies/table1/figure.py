"""Error against run time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.run import Finished
from experiments.reporting import estimates
from experiments.reporting.columns import display_name
from experiments.reporting.curves import (
    error_axis,
    error_bars,
    plain_decades,
    published_point,
)
from experiments.reporting.plot import by_panel, handle, look_of, title, wrapped
from experiments.reporting.rows import Row, row
from experiments.reporting.study import WIDTH
from experiments.reporting.text import split_name
from experiments.studies.table1 import models
from experiments.studies.table1.rows import hdc_seconds

_LEGEND_WIDTH = 22  # characters of a name on one line


def error_vs_time(figure: Figure, lines: pd.DataFrame) -> None:
    """Test error against training time relative to HDC, a curve per model and seed: the paper's
    models with its points, then the others."""
    runs = Groups.of(lines)
    hdc = runs.group(models.scene(), "hdc")
    groups = {group.model: group for group in _groups(runs, hdc)}
    rows = {model: row(group, hdc) for model, group in groups.items()}
    shown = by_panel(list(groups))
    figure.set_size_inches(WIDTH, 0.8 + 2.3 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, names in zip(panels, shown, strict=True):
        floor = error_axis(axes, list(rows.values()))
        axes.set_xscale("log")
        for model in names:
            _draw(axes, groups[model], hdc, rows[model], floor)
        axes.set_ylabel("test error")
        axes.legend(
            handles=list(map(_entry, names)),
            loc="lower left",
            bbox_to_anchor=(0, 1),
            ncols=2,
        )
    _draw_published(panels[0], floor)
    panels[-1].set_xlabel("training time relative to HDC")
    plain_decades(panels[-1])
    split = split_name(hdc.runs[0].config["split"])
    text = "Test error against training time"
    title(figure, panels[0], text, list(rows.values()), split)


def _entry(model: str) -> Line2D:
    """The legend's entry of a model, its name wrapped so that two columns of entries fit."""
    entry = handle(model)
    entry.set_label(wrapped(display_name(model), _LEGEND_WIDTH))
    return entry


def _groups(runs: Groups, hdc: Group) -> Iterator[Group]:
    """The groups of Table I whose times are relative to HDC: the paper's models, HDC first, fast
    ones, one's own."""
    known = [*configs.models("paper"), *configs.models("fast"), models.DESCENT]
    for model in (*known, *runs.extra_models(models.scene())):
        group = runs.group(models.scene(), model)
        if any(hdc_seconds(run, hdc) is not None for run in group.runs):
            yield group


def _draw(axes: Axes, group: Group, hdc: Group, line: Row, floor: float) -> None:
    """A curve per run of a model, and its error with the interval after full training."""
    ends = []
    for run in group.runs:
        hdc_s = hdc_seconds(run, hdc)
        if hdc_s is not None:
            _curve(axes, run, floor, hdc_s)
            ends.append(run.training_s / hdc_s)
    if not isinstance(line["training_time_s"], str):
        at = [float(np.median(ends))]
        error_bars(axes, group.model, at, [line], floor, marker=False)


def _curve(
    axes: Axes,
    run: Finished,
    floor: float,
    hdc_s: float,
) -> None:
    """Error over the reports of one run, times relative to HDC; a marker where training accuracy
    passed 90 %."""
    look = look_of(run.model_label) | {"alpha": 0.75, "lw": 0.8}
    tested = [report for report in run.curve if "test_accuracy" in report]
    if not tested:
        return
    times = np.array([report["training_s"] for report in tested]) / hdc_s
    errors = [max(1 - report["test_accuracy"], floor) for report in tested]
    reached = estimates.training_time(run) / hdc_s
    marked: list[int] = []
    if np.isfinite(reached):
        marked = [int(np.abs(times - reached).argmin())]
    axes.plot(times, errors, markevery=marked, ms=5, **look)


def _draw_published(axes: Axes, floor: float) -> None:
    """The paper's points."""
    for model in models.PAPER:
        known = models.papers_numbers(model)
        error = max(1 - known["published_test_accuracy"], floor)
        ratio = known["published_training_time_over_hdc"]
        published_point(axes, model, ratio, error, 9)
