"""Table I, other competitors on the same frames, and error against run time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.protocol import evaluate
from experiments.records import configs
from experiments.records.results import Results, Run
from experiments.reporting import estimates
from experiments.reporting import rows as rows_of
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    error_axis,
    error_bars,
    handle,
    plain_decades,
    style_of,
    title,
)
from experiments.reporting.rows import PAPER_HEADS, PUBLISHED, VALUES, columns, published_row, row
from experiments.reporting.study import RUN, Plot, Quantity, Study
from experiments.reporting.table import Table, frame

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


def tables(results: Results) -> Iterator[Table]:
    """Table I with the published numbers; and every model on its scene."""
    scene = configs.sweep("table1")["scene"][0]
    hdc = results.group(scene, "hdc")
    rows = [row(results.group(scene, model), hdc) | published_row(model) for model in _LINES]
    made = rows_of.commands(results.group(scene, model) for model in _LINES)
    yield Table(
        "table1",
        rows_of.caption(rows, "Table I, published and measured"),
        frame(rows, (*VALUES, *PUBLISHED)),
        columns(
            "Model",
            "Seeds",
            "Training time, s, paper",
            "Training time, s",
            "× HDC, paper",
            "× HDC",
            "Training accuracy, %, paper",
            "Training accuracy, %",
            "Test accuracy, %, paper [95 %]",
            "Test accuracy, %, maximum",
            "Test accuracy, %, final [95 %]",
            "McNemar p",
            "Size",
            "Status",
        ),
        rows_of.notes(rows),
        made or [f"{RUN}table1"],
        key=("Model",),
        common=PAPER_HEADS,
    )


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
        time = estimates.median_time([estimates.training_time(run) for run in group.runs])
        known = np.isfinite([time.low, time.high]).all()
        yield Quantity(
            f"table1/{model}_training_time",
            line["training_time_s"],
            time.low if known else None,
            time.high if known else None,
            "Student, logarithms over seeds" if known else "",
            n=len(group.runs),
            seeds=len(group.runs),
            made_by=made,
            note=f"median; {line['cpu']}, {line['threads']} threads; {_PUBLISHED_COMPUTER}",
        )
        for kind, n in (("train", line["n_train"] * len(group.runs)), ("test", line["n_test"])):
            best, final = line[f"{kind}_accuracy_max"], line[f"{kind}_accuracy_final"]
            if best is None:
                continue
            low, high = evaluate.wilson(round(best * n), n)
            yield Quantity(
                f"table1/{model}_{'training' if kind == 'train' else kind}_accuracy",
                100 * best,
                100 * low,
                100 * high,
                "Wilson, samples of all seeds",
                n=n,
                seeds=len(group.runs),
                made_by=made,
                note=f"maximum of the run, as published; {100 * final:.4g} % at its end "
                f"({line['stop']})",
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
            error = 1 - known["published_test_accuracy"]
            axes.plot(
                known["published_training_time_s"],
                max(error, floor),
                "*",
                markersize=9,
                color=style_of(model)[0],
                markeredgecolor="black",
                markeredgewidth=0.6,
                zorder=5,
                clip_on=False,
            )
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
