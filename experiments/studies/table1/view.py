"""Table I, other competitors on the same frames, and error against run time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records import configs
from experiments.records.results import Group, Results, Run
from experiments.reporting import estimates
from experiments.reporting import rows as rows_of
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    error_axis,
    error_bars,
    handle,
    plain_decades,
    published_point,
    style_of,
    title,
)
from experiments.reporting.rows import (
    PAPER_HEADS,
    PUBLISHED,
    VALUES,
    Row,
    columns,
    published_row,
    row,
)
from experiments.reporting.study import RUN, Plot, Quantity, Study
from experiments.reporting.table import Table, frame
from experiments.studies.benchmark.view import ORDINARY, ORDINARY_NOTE, ordinary_training_s

PAPER = ("hdc", "softmax", "cnn1", "cnn3")
# The zero start of softmax has a line of its own: where a training ends early, the start decides.
_LINES = ("hdc", "softmax", "softmax_zero", "cnn1", "cnn3")
_DRAWN = (
    "hdc",
    "softmax",
    "softmax_zero",
    "softmax_dual",
    "cnn1",
    "cnn1_fast",
    "cnn3",
    "cnn3_fast",
)
_PUBLISHED_COMPUTER = "paper: Apple M1"
_COLUMNS = columns(
    "Model",
    "Seeds",
    "Training time, s, paper",
    "Training time, s",
    "× HDC, paper",
    "× HDC",
    "× HDC by ordinary routes",
    "Training accuracy, %, paper",
    "Training accuracy, %",
    "Test accuracy, %, paper [95 %]",
    "Test accuracy, %, maximum",
    "Test accuracy, %, final [95 %]",
    "− HDC, points [95 %]",
    "Seeds above, below HDC",
    "Size",
    "Status",
)


def tables(results: Results) -> Iterator[Table]:
    """Table I with the published numbers."""
    scene = configs.sweep("table1")["scene"][0]
    hdc = results.group(scene, "hdc")
    rows = []
    for model in _LINES:
        group = results.group(scene, model)
        rows.append(row(group, hdc) | published_row(model) | _over_ordinary(results, group))
    made = rows_of.commands(results.group(scene, model) for model in _LINES)
    yield Table(
        "table1",
        rows_of.caption(rows, "Table I, published and measured"),
        frame(rows, (*VALUES, *PUBLISHED)),
        _COLUMNS,
        " ".join([rows_of.notes(rows, _COLUMNS), *_of_few_seeds(rows), ORDINARY_NOTE]),
        made or [f"{RUN}table1"],
        key=("Model",),
        common=PAPER_HEADS,
    )


def _over_ordinary(results: Results, group: Group) -> Row:
    """The training time over that of HDC by ordinary routes, of what reached its end."""
    seconds = ordinary_training_s(results, group)
    if seconds is None or not group.runs:
        return {}
    median = estimates.quartiles([estimates.training_time(run) for run in group.runs])[1]
    return {"training_time_over_ordinary_hdc": median / seconds} if np.isfinite(median) else {}


def _of_few_seeds(rows: Sequence[Row]) -> list[str]:
    most = max(row["seeds"] for row in rows)
    if most < 2:
        return []
    return [
        f"With {most} seeds no sign test over them can go below p = {2 / 2**most:g}, whatever the "
        "models are."
    ]


def plots(results: Results) -> Iterator[Plot]:
    """Error against run time."""
    if "touch" not in results.scenes:
        return
    caption = (
        "Test error against training time (Table I): a curve a model and seed. Stars: the paper's."
    )
    yield Plot(
        "error_vs_time",
        caption,
        lambda: error_vs_time(results),
        [f"{RUN}table1", f"{RUN}table1_extended"],
    )


def quantities(results: Results) -> Iterator[Quantity]:
    """Times and accuracies of Table I, in seconds and percent, and the learning rate."""
    scene = configs.sweep("table1")["scene"][0]
    for model in PAPER:
        group = results.group(scene, model)
        if not group.runs:
            continue
        line = row(group, group)
        made = " && ".join(rows_of.commands([group]))
        yield Quantity(
            f"table1/{model}_training_time",
            line["training_time_s"],
            n=len(group.runs),
            seeds=len(group.runs),
            made_by=made,
            note=f"median; {line['cpu']}, {line['threads']} threads; {_PUBLISHED_COMPUTER}",
        )
        if model == "hdc":
            yield Quantity.of(
                "table1/hdc_test_accuracy",
                estimates.share_of_one_sensor(group),
                ONE_SENSOR,
                100,
                n=line["n_test"],
                seeds=len(group.runs),
                made_by=made,
            )
            continue
        yield from _ratios(results, group, made)
        for kind in ("train", "test"):
            best, final = line[f"{kind}_accuracy_max"], line[f"{kind}_accuracy_final"]
            if best is not None:
                yield Quantity(
                    f"table1/{model}_{'training' if kind == 'train' else kind}_accuracy",
                    100 * best,
                    n=line["n_train"] * len(group.runs) if kind == "train" else line["n_test"],
                    seeds=len(group.runs),
                    made_by=made,
                    note="maximum of the run, as published, of which there is no interval; "
                    f"{100 * final:.4g} % at its end ({line['stop']})",
                )
    groups = [results.group(scene, model) for model in PAPER[1:]]
    rates = {run.record.config["model"]["lr"] for group in groups for run in group.runs}
    if len(rates) == 1:
        yield Quantity(
            "table1/learning_rate", rates.pop(), note="softmax and CNNs", made_by=f"{RUN}table1"
        )
    hdc = results.group(scene, "hdc")
    if hdc.runs:
        yield Quantity("touch/labels", len(hdc.classes), made_by=f"{RUN}table1")


def _ratios(results: Results, group: Group, made: str) -> Iterator[Quantity]:
    """Training time over HDC's: as it is written here, and by ordinary routes.

    In the first both times of a run are of the same seed; the second has one time for all.
    """
    name = f"table1/{group.model}_time_over_hdc"
    hdc = results.group(group.scene, "hdc")
    times = {run.seeds: estimates.training_time(run) for run in group.runs}
    middle = estimates.quartiles(list(times.values()))[1]
    own = {run.seeds: estimates.training_time(run) for run in hdc.runs}
    ordinary = ordinary_training_s(results, group)
    for condition, denominators, by in (
        ("HDC as written here", own, made),
        (ORDINARY, dict.fromkeys(times, ordinary) if ordinary else {}, f"{RUN}benchmark"),
    ):
        pairs = [(times[key], denominators[key]) for key in times if key in denominators]
        if not pairs or not np.isfinite(middle):
            yield Quantity(name, None, condition=condition, made_by=by)
            continue
        value = middle / float(np.median(list(denominators.values())))
        found = estimates.one_ratio(value, [math.log(one / other) for one, other in pairs])
        yield Quantity.of(
            name,
            found,
            "of one run, Student of logarithms over seeds",
            condition=condition,
            n=len(pairs),
            seeds=len(pairs),
            made_by=by,
            note="" if group.model == "softmax" else "the network's sizes are ours",
        )


def error_vs_time(results: Results) -> Figure:
    """Test error against training time, a curve for each model and seed; the paper's points."""
    scene = configs.sweep("table1")["scene"][0]
    models = (*_DRAWN, *results.extra_models(scene))
    groups = [results.group(scene, model) for model in models]
    rows = [row(group, groups[0]) for group in groups]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.7))
        floor = error_axis(axes, rows)
        axes.set_xscale("log")
        for group, line in zip(groups, rows, strict=True):
            for run in group.runs:
                _curve(axes, run, floor)
            if group.runs and not isinstance(line["training_time_s"], str):
                error_bars(axes, group.model, [line["total_time_s"]], [line], floor, marker=False)
        for model in PAPER:
            known = published_row(model)
            time, error = known["published_training_time_s"], 1 - known["published_test_accuracy"]
            published_point(axes, model, time, max(error, floor), 9)
        axes.set_xlabel("training time (s)")
        axes.set_ylabel("test error")
        plain_decades(axes)
        shown = [group.model for group in groups if group.runs]
        handles = [handle(model) for model in shown]
        handles += [
            Line2D([], [], ls="", marker=marker, mfc="white", mec="black", ms=size, label=label)
            for marker, size, label in (
                ("*", 8, "paper, Table I"),
                ("o", 6, "training accuracy > 90 %"),
            )
        ]
        title(figure, axes, "Test error against training time", rows, shown, models, handles)
    return figure


def _curve(axes: Axes, run: Run, floor: float) -> None:
    """Error over the reports of one run; the point where it had learnt is ringed."""
    model = run.model
    colour, marker, line = style_of(model)
    points = [
        (row["training_s"], 1 - row["test_accuracy"]) for row in run.curve if "test_accuracy" in row
    ]
    if not points:
        return
    times, errors = np.array(points).T
    axes.plot(
        times,
        np.maximum(errors, floor),
        color=colour,
        ls=line,
        lw=0.8,
        alpha=0.75,
        marker=marker if len(times) < 3 else None,
    )
    reached = estimates.training_time(run)
    if np.isfinite(reached):
        at = int(np.argmin(np.abs(times - reached)))
        axes.plot(times[at], max(errors[at], floor), "o", mfc="white", mec=colour, ms=5, zorder=4)


STUDY = Study(
    "table1",
    "Table I",
    "Does HDC recognise touches better than softmax regression and convolutional networks, and "
    "learn in a hundredth of their time? Five labels, N = 400.",
    1,
    tables,
    plots,
    quantities,
    front=True,
)
