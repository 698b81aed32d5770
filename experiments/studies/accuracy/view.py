"""Accuracy against the number of training samples (Fig. 5(b)), and against the pixels seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from experiments.records import configs
from experiments.records.results import Group, Results
from experiments.reporting import estimates, published
from experiments.reporting import rows as rows_of
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    accuracy_curves,
    apart,
    error_axis,
    error_bars,
    handle,
    measured_models,
    plain_decades,
    published_point,
    star,
    style_of,
    title,
)
from experiments.reporting.rows import VALUES, Row, columns, published_row, row, swept
from experiments.reporting.study import RUN, Plot, Quantity, Study
from experiments.reporting.table import Table, frame

# Where the published accuracies are drawn: all at N = 400, the two equal ones side by side.
PUBLISHED_N = {"hdc": 400, "softmax": 400, "cnn1": 380, "cnn3": 421}

_COLUMNS = columns(
    "Model",
    "N",
    "D",
    "Seeds",
    "Test accuracy, %, maximum",
    "Test accuracy, %, final [95 %]",
    "Training time, s",
    "Prediction, ms a frame",
    "Size",
    "Status",
)
_TITLES = {
    "accuracy_vs_n": "Accuracy against the number N of training samples",
    "accuracy_vs_d": "Accuracy against the number D of pixels seen",
    "work_precision": "Accuracy against the time of a prediction",
}
# What makes the runs of a table, where it is not the experiment of its name alone.
_EXPERIMENTS = {"accuracy_vs_n": ("accuracy_vs_n", "accuracy_vs_n_cnn")}


def rows(results: Results, name: str) -> list[Row]:
    """Rows of one of the sweeps; over N also of models that no experiment has."""
    found = swept(results, _EXPERIMENTS.get(name, (name,)))
    if name == "accuracy_vs_n":
        scene = configs.sweep(name)["scene"][0]
        extra = results.extra_models(scene)
        for group in results.groups():
            if group.scene == scene and group.model in extra and group.pixels is None:
                found.append(row(group, results.group(scene, "hdc", group.n_train)))
    return found


def tables(results: Results) -> Iterator[Table]:
    """One table a sweep."""
    for name, what in _TITLES.items():
        lines = rows(results, name)
        if _is_curve(lines):
            yield Table(
                name,
                rows_of.caption(lines, what),
                frame(lines, VALUES),
                _COLUMNS,
                rows_of.notes(lines, _COLUMNS),
                [f"{RUN}{experiment}" for experiment in _EXPERIMENTS.get(name, (name,))],
            )


def plots(results: Results) -> Iterator[Plot]:
    """The same as curves."""
    others = swept(results, ["table1", "table1_extended"])
    for name, caption, draw in (
        (
            "accuracy_vs_n",
            "Test accuracy against the number of training samples (Fig. 5(b)).",
            accuracy_vs_n,
        ),
        (
            "accuracy_vs_d",
            "Test accuracy against the number of pixels seen: the dimension of a hypervector.",
            accuracy_vs_d,
        ),
        (
            "work_precision",
            "Test error against the time a prediction takes.",
            partial(work_precision, table=others),
        ),
    ):
        lines = rows(results, name)
        if _is_curve(lines):
            made = [f"{RUN}{experiment}" for experiment in _EXPERIMENTS.get(name, (name,))]
            yield Plot(name, caption, partial(draw, lines), made)


def _is_curve(lines: Sequence[Row]) -> bool:
    """Whether there are runs at more than one place of the sweep."""
    return len({(line["n_train"], line["pixels"]) for line in lines if line["seeds"]}) > 1


def quantities(results: Results) -> Iterator[Quantity]:
    """Fig. 5(b): the number of training samples at which HDC exceeds 90 %."""
    params = configs.sweep("accuracy_vs_n")
    sizes = configs.numbers(params["split.n_train"])
    groups = [results.group(params["scene"][0], "hdc", n) for n in sizes]
    groups = [group for group in groups if group.runs]
    found = crossing(groups) if len(groups) > 1 else estimates.Estimate(math.nan)
    if math.isnan(found.value):
        return
    yield Quantity.of(
        "accuracy_vs_n/n_for_90_percent",
        found,
        f"{estimates.ONE_SENSOR}, each where its own curve first crosses",
        n=min(len(group.right) for group in groups),
        seeds=min(len(group.runs) for group in groups),
        made_by=f"{RUN}accuracy_vs_n",
    )


def crossing(groups: Sequence[Group]) -> estimates.Estimate:
    """N at which accuracy first crosses 90 %, with the interval of one sensor: each has a curve of
    its own over these groups of different N. NaN if one never does."""
    curves: dict[str, dict[int, float]] = {}
    for group in groups:
        for run in group.runs:
            accuracy = run.record.test_accuracy_final
            curves.setdefault(run.seeds, {})[run.record.n_train] = accuracy
    found = [estimates.crossing(list(one), list(one.values())) for one in curves.values()]
    return estimates.one_sensor(found).within(0, math.inf)


def accuracy_vs_n(rows: Sequence[Row]) -> Figure:
    """Test accuracy against the number of training samples (Fig. 5(b) of the paper)."""
    paper = ["hdc", "softmax", "softmax_dual", "cnn1_fast", "cnn3_fast"]
    others = [
        "hdc",
        "hdc_integer",
        "hdc_online",
        "record_hdc",
        "ridge",
        "correlation",
        "nearest_neighbour",
    ]
    others += [m for m in dict.fromkeys(r["model"] for r in rows) if m not in (*paper, *others)]
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(2, 1, figsize=(WIDTH, 5.6), sharex=True)
        for axes, models in zip(panels, (paper, others), strict=True):
            accuracy_curves(axes, rows, models, "n_train", PUBLISHED_N.values())
            handles = [handle(m) for m in measured_models(rows, models)]
            if _maxima(axes, rows, models):
                mark: dict[str, Any] = {
                    "ls": "",
                    "marker": "o",
                    "mec": "0.3",
                    "mfc": "white",
                    "ms": 2.2,
                }
                handles.append(Line2D([], [], label="maximum of a run", **mark))
            if axes is panels[0]:
                handles.append(star("paper, Table I"))
            axes.legend(handles=handles, loc="lower right")
        for model, n in PUBLISHED_N.items():
            largest = 100 * published_row(model)["published_test_accuracy"]
            published_point(panels[0], model, n, largest, 8)
        limit = published.numbers()["accuracy_vs_n/n_for_90_percent"].value
        for axes in panels:
            axes.plot([limit, limit], [0, 90], color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.axhline(90, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
        panels[0].text(
            limit * 0.95,
            24,
            f"paper: > 90 %\nonly for N > {limit:g}",
            ha="right",
            color="0.3",
            fontsize=6,
        )
        ticks = [5, 10, 20, 50, 100, 200, 400]
        panels[1].xaxis.set_major_locator(FixedLocator(ticks))
        panels[1].xaxis.set_minor_locator(NullLocator())
        panels[1].xaxis.set_major_formatter(FuncFormatter(lambda n, _: f"{n:g}"))
        panels[1].set_xlabel("training samples N")
        title(
            figure,
            panels[0],
            "Test accuracy against training samples",
            rows,
            measured_models(rows, paper + others),
            paper + others,
        )
    return figure


def _maxima(axes: Axes, rows: Sequence[Row], models: Sequence[str]) -> bool:
    """The largest accuracy of a run, the published reading, where it is above the final one.

    A small open marker, joined to the curve; whether there is any.
    """
    found = False
    for k, model in enumerate(models):
        colour, _, _ = style_of(model)
        for line in rows:
            if line["model"] != model or not line["seeds"] or line["test_accuracy_max"] is None:
                continue
            final, largest = 100 * line["test_accuracy_final"], 100 * line["test_accuracy_max"]
            if largest - final > 0.5:
                x = apart(line["n_train"], k, len(models))
                axes.plot([x, x], [final, largest], color=colour, lw=0.5, ls=":", zorder=1)
                axes.plot(x, largest, "o", color=colour, mfc="white", ms=2.2, mew=0.6)
                found = True
    return found


def accuracy_vs_d(rows: Sequence[Row]) -> Figure:
    """Test accuracy against the number of pixels seen, which is HDC's dimension."""
    models = ["hdc", "softmax_dual", "ridge", "correlation", "nearest_neighbour"]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 2.9))
        accuracy_curves(axes, rows, models, "pixels")
        axes.legend(handles=[handle(m) for m in measured_models(rows, models)], loc="lower right")
        whole = max((line["pixels"] or 0 for line in rows if line["seeds"]), default=0)
        axes.set_xlabel(f"pixels seen, D (whole frame: {whole:,})" if whole else "pixels seen, D")
        title(
            figure,
            axes,
            "Test accuracy against dimension",
            rows,
            measured_models(rows, models),
            models,
        )
    return figure


def work_precision(rows: Sequence[Row], table: Sequence[Row]) -> Figure:
    """Test error against the time to predict a single frame; from left to right D grows.

    Args:
        rows: by model and number of pixels.
        table: rows of models that were run on whole frames only.
    """
    models = list(dict.fromkeys(line["model"] for line in rows))
    whole = [line for line in table if line["model"] not in models]
    everything = [*rows, *whole]
    names = [*models, *(line["model"] for line in whole)]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.7))
        floor = error_axis(axes, everything)
        axes.set_xscale("log")
        for model in names:
            lines = [r for r in everything if r["model"] == model and r["seeds"]]
            times = [1e3 * line["predict_single_s"] for line in lines]
            error_bars(axes, model, times, lines, floor)
        seen = [line["pixels"] for line in rows if line["pixels"]]
        axes.set_xlabel(
            "time to predict a single frame (ms)"
            + (f"\nalong a curve: D = {min(seen):,} … {max(seen):,} pixels" if seen else "")
        )
        axes.set_ylabel("test error")
        plain_decades(axes)
        shown = measured_models(everything, names)
        handles = [handle(model) for model in shown]
        title(figure, axes, "Test error against prediction time", everything, shown, names, handles)
    return figure


STUDY = Study(
    "accuracy",
    "Few samples, few pixels",
    "How many training samples are enough, and how many pixels? The paper exceeds 90 % for N > 20.",
    2,
    tables,
    plots,
    quantities,
    front=True,
)
