"""Error against run time."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.run import Finished
from experiments.reporting import estimates
from experiments.reporting.curves import (
    error_axis,
    error_bars,
    plain_decades,
    published_point,
)
from experiments.reporting.plot import handle, look_of, star, title
from experiments.reporting.rows import row
from experiments.studies.table1 import models


def error_vs_time(figure: Figure, lines: pd.DataFrame) -> None:
    """Test error against training time over HDC's, a curve for each model and seed; the paper's
    points."""
    runs = Groups.of(lines)
    groups = _curves_of(runs)
    rows = [row(group, groups[0]) for group in groups]
    axes = figure.subplots()
    floor = error_axis(axes, rows)
    axes.set_xscale("log")
    _draw_curves(axes, runs, floor)
    hdc_s = _hdc_s(runs)
    for line in rows:
        if not isinstance(line["training_time_s"], str):
            at = [line["total_time_s"] / hdc_s]
            error_bars(axes, line["model"], at, [line], floor, marker=False)
    for model in models.PAPER:
        known = models.papers_numbers(model)
        error = max(1 - known["published_test_accuracy"], floor)
        ratio = known["published_training_time_over_hdc"]
        published_point(axes, model, ratio, error, 9)
    axes.set(xlabel="training time relative to HDC", ylabel="test error")
    plain_decades(axes)
    shown = [group.model for group in groups]
    handles = [handle(model) for model in shown]
    handles.append(star("paper, Table I"))
    text = "Test error against training time"
    title(figure, axes, text, rows, shown, shown, handles)


def _tested(run: Finished) -> list[tuple[float, float]]:
    """Seconds of training and test error wherever a run was tested."""
    reports = [report for report in run.curve if "test_accuracy" in report]
    return [(report["training_s"], 1 - report["test_accuracy"]) for report in reports]


def _curves_of(runs: Groups) -> list[Group]:
    """The groups of Table I that have runs, HDC first: the paper's models, fast ones, one's own."""
    known = configs.models("paper", "fast")
    every = [*known, models.DESCENT, *runs.extra_models(models.scene())]
    groups = [runs.group(models.scene(), model) for model in every]
    return [group for group in groups if group.runs]


def _draw_curves(axes: Axes, runs: Groups, floor: float) -> None:
    hdc_s = _hdc_s(runs)
    for group in _curves_of(runs):
        for run in group.runs:
            _curve(axes, run, floor, hdc_s)


def _hdc_s(runs: Groups) -> float:
    """Training time of HDC in Table I, median over runs."""
    of_hdc = runs.group(models.scene(), "hdc").runs
    times = [estimates.training_time(run) for run in of_hdc]
    return float(np.median(times)) if times else math.nan


def _curve(
    axes: Axes,
    run: Finished,
    floor: float,
    hdc_s: float,
) -> None:
    """Error over the reports of one run, times over HDC's; a marker where training accuracy passed
    90 %."""
    look = look_of(run.model_label) | {"alpha": 0.75, "lw": 0.8}
    tested = _tested(run)
    if not tested:
        return
    seconds, errors = np.array(tested).T
    times = seconds / hdc_s
    errors = np.maximum(errors, floor)
    reached = estimates.training_time(run) / hdc_s
    marked: list[int] = []
    if np.isfinite(reached):
        marked = [int(np.abs(times - reached).argmin())]
    axes.plot(times, errors, markevery=marked, ms=5, **look)
