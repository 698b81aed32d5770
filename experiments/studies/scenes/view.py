"""Every model on every scene: test errors, confusions, learning curves; Figs. 5(a), 6, 7 and 9.

Scenes of measured optics come before simulated ones.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator, ScalarFormatter

from experiments.records import configs
from experiments.records.record import Finished
from experiments.records.results import Group, Results
from experiments.reporting import estimates
from experiments.reporting import rows as rows_of
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.plot import (
    CONFUSION_MAP,
    PRINTED,
    WIDTH,
    accuracy_curves,
    handle,
    head,
    literal,
    look_of,
    matrix,
    measured_models,
    panel,
    plain_decades,
    seeds_of,
    style_of,
    title,
)
from experiments.reporting.rows import Row, row
from experiments.reporting.study import RUN, Quantity, Study
from experiments.reporting.table import frame

EXPERIMENT = "all_scenes"
BY_STEPS = ("softmax", "cnn1_fast")  # iterative models, run where an epoch is short
LETTERS = "abcdefghijklmnopqrstuvwxyz"
# Which figure of the paper shows the confusion of a scene.
PAPER = {
    "touch": "Fig. 5(a)",
    "finger": "Fig. 6(b)",
    "spatial": "Fig. 7(b)",
    "tactile": "Fig. 9(d)",
}
SHOWN = (
    "scene",
    "origin",
    "model",
    "seeds",
    "test_accuracy_final",
    "over_hdc",
    "training_time_s",
    "training_time_over_hdc",
    "predict_single_s",
    "model_bytes",
    "status",
)

STUDY = Study(
    "scenes",
    "Models by scene",
    "Is HDC the most accurate model where not every model is right, and how do the models do on "
    "every scene that was run, own recordings included?",
    2.2,
)


# Rows ---------------------------------------------------------------------------------------------


def groups(results: Results) -> list[Group]:
    """The runs of each scene and model on all pixels with the most training samples, measured
    scenes first, HDC first in each."""
    whole: dict[tuple[str, str], Group] = {}
    for group in results.groups():
        key = group.scene, group.model
        if group.pixels is None and group.runs:
            whole[key] = max(whole.get(key, group), group, key=lambda g: g.n_train or math.inf)
    order = [*configs.sweep(EXPERIMENT)["scene"]]

    def place(group: Group) -> tuple[bool, int, str, bool]:
        at = order.index(group.scene) if group.scene in order else len(order)
        simulated = group.runs[0].record.scene.origin == "simulated"
        return simulated, at, group.scene, group.model.partition(" (")[0] != "hdc"

    return sorted(whole.values(), key=place)


def lines_of(results: Results) -> list[Row]:
    """A row of a table for each of :func:`groups`."""
    return [
        row(group, results.group(group.scene, "hdc", group.n_train)) for group in groups(results)
    ]


def few_samples(results: Results) -> dict[str, list[Row]]:
    """Rows of models with several N, by scene; touch has a study of its own."""
    curves: dict[tuple[str, str], list[Row]] = {}
    for group in results.groups():
        if group.pixels is None and group.runs and group.scene != "touch":
            hdc = results.group(group.scene, "hdc", group.n_train)
            curves.setdefault((group.scene, group.model), []).append(row(group, hdc))
    scenes: dict[str, list[Row]] = {}
    for (scene, _), lines in curves.items():
        if len(lines) > 1:
            scenes.setdefault(scene, []).extend(lines)
    return scenes


@STUDY.table(
    EXPERIMENT,
    title="Every model on every scene",
    note="Fibre: frames computed from measured transmission matrices. Each model on all pixels of "
    "a scene and the most training samples that it was given.",
    shown=SHOWN,
)
def all_scenes(results: Results) -> pd.DataFrame | None:
    """One row a scene and model."""
    lines = lines_of(results)
    if not lines:
        return None
    data = frame(lines)
    data.attrs["commands"] = rows_of.commands(groups(results))
    return data


# Test error by scene ------------------------------------------------------------------------------


@STUDY.figure(
    EXPERIMENT,
    caption="Test error against training time, by scene. Fibre: frames computed from measured "
    "transmission matrices. Pale: training accuracy never exceeded 90 %, until the run stopped.",
    needs=lambda results: bool(groups(results)),
    commands=(f"{RUN}{EXPERIMENT} scene=fibre,fibre_grouped", f"{RUN}{EXPERIMENT}"),
)
def errors_by_scene(figure: Figure, results: Results) -> None:
    """A panel a scene that several models of the experiment were run on."""
    models = [*configs.sweep(EXPERIMENT)["model"], *BY_STEPS]
    scenes: dict[str, list[Row]] = {}
    for line in lines_of(results):
        if line["model"] in models or line["model"] in results.extra_models(line["scene"]):
            scenes.setdefault(line["scene"], []).append(line)
    scenes = {scene: lines for scene, lines in scenes.items() if len(lines) > 1} or scenes
    panels = grid(figure, len(scenes), 1.6)
    for axes, letter, (scene, lines) in zip(panels, LETTERS, scenes.items(), strict=False):
        _errors(axes, lines)
        axes.set(xlabel="training time (s)", ylabel="test error (%)")
        panel(axes, letter, f"{literal(scene)}\n{lines[0]['origin']}")
    names = dict.fromkeys(line["model"] for lines in scenes.values() for line in lines)
    figure.legend(handles=[handle(name) for name in names], loc="outside lower center", ncols=2)
    head(figure, "Test error by scene, 95 % intervals", [])


def _errors(axes: Axes, lines: list[Row]) -> None:
    """One scene; measured ones have a background of their own."""
    axes.set_xscale("log")
    if lines[0]["origin"] != "simulated":
        axes.set_facecolor("#FFF6E5")
    largest = 0.0
    for line in lines:
        error, low, high = (
            100 * (1 - line[f"test_accuracy_final{end}"]) for end in ("", "_high", "_low")
        )
        colour, marker, _ = style_of(line["model"])
        reached = not isinstance(line["training_time_s"], str)
        axes.errorbar(
            line["training_time_s"] if reached else line["total_time_s"],
            error,
            yerr=[[max(0.0, error - low)], [max(0.0, high - error)]],
            color=colour,
            marker=marker,
            mfc=look_of(line["model"])["mfc"],
            ms=4,
            lw=0.7,
            capsize=1.2,
            alpha=1.0 if reached else 0.4,
        )
        largest = max(largest, error)
    axes.set_ylim(-0.03 * max(5.0, 1.5 * largest), max(5.0, 1.5 * largest))
    plain_decades(axes)
    # A panel may span less than a decade, which would have one label, or all of them.
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(axis="x", labelsize=6)


def grid(figure: Figure, n: int, height: float) -> list[Axes]:
    """Axes of so many panels, two in a row, and the figure as high as they need."""
    lines = -(-n // 2)
    figure.set_size_inches(WIDTH, 1.4 + height * lines)
    return [figure.add_subplot(lines, 2, k + 1) for k in range(n)]


# Confusions ---------------------------------------------------------------------------------------


@STUDY.figure(
    "confusions",
    caption="Confusion of the classes by HDC, in percent of the true label (rows), test samples of "
    "all seeds together (Figs. 5(a), 6(b) and 9(d)); less than 0.5 % is left blank.",
    needs=lambda results: bool(confused(results)),
    commands=(f"{RUN}scenes", f"{RUN}{EXPERIMENT}", f"{RUN}tactile_controls"),
)
def confusions(figure: Figure, results: Results) -> None:
    """A panel a scene."""
    chosen = confused(results)
    panels = grid(figure, len(chosen), 1.55)
    for axes, letter, group in zip(panels, LETTERS, chosen, strict=False):
        confusion(axes, group)
        axes.set(xlabel="predicted", ylabel="true")
        axes.tick_params(axis="x", rotation=90)
        of = f", {PAPER[group.scene]}" if group.scene in PAPER else ""
        name = group.model.partition(" (")[0]
        by = "" if name == "hdc" else f"{rows_of.display_name(name)}, "
        accuracy = 100 * estimates.share(group).value
        scene = textwrap.fill(literal(group.scene.replace("_", " ")), 17)
        panel(axes, letter, f"{scene}{of}\n{by}{accuracy:.1f} %")
    frames = rows_of.frames_of([{"origin": g.runs[0].record.scene.origin} for g in chosen])
    head(figure, "Confusion by HDC, % of the true label", [frames])


def confused(results: Results) -> list[Group]:
    """HDC's runs on each scene of few classes; where it was not run, the first model's."""
    by_scene: dict[str, Group] = {}
    for group in groups(results):
        if len(group.classes) <= PRINTED:
            by_scene.setdefault(group.scene, group)
    return list(by_scene.values())


def confusion(axes: Axes, group: Group) -> None:
    """Shares of each true class in percent."""
    counts = group.confusion()
    shares = 100 * counts / np.maximum(counts.sum(1, keepdims=True), 1)
    few = len(group.classes) <= PRINTED
    cells = [[f"{x:.0f}" if x >= 0.5 else "" for x in line] for line in shares] if few else None
    gamma = 1 if few else 0.4  # a colour has to show one of 100 test samples
    bar = matrix(axes, shares, group.classes, cells, CONFUSION_MAP, (0, 100), gamma)
    if few:
        bar.remove()
    else:
        bar.set_ticks([0, 5, 20, 50, 100])


# Few samples --------------------------------------------------------------------------------------


@STUDY.figure(
    "accuracy_vs_n_scenes",
    caption="Test accuracy against the number of training samples, by scene.",
    needs=lambda results: bool(few_samples(results)),
    commands=(f"{RUN}accuracy_vs_n scene=fibre",),
)
def learning_curves(figure: Figure, results: Results) -> None:
    """A panel a scene that was run with several N."""
    scenes = few_samples(results)
    figure.set_size_inches(WIDTH, 1.2 + 2.1 * len(scenes))
    every = [line for lines in scenes.values() for line in lines]
    models = measured_models(every, [line["model"] for line in every])
    for k, (scene, lines) in enumerate(scenes.items()):
        axes = figure.add_subplot(len(scenes), 1, k + 1)
        accuracy_curves(axes, lines, models, "n_train")
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_major_locator(FixedLocator([5, 10, 20, 50, 100, 200, 400, 1000, 4000]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel("training samples N")
        panel(axes, LETTERS[k], literal(scene))
    handles = [handle(model) for model in models]
    title(figure, figure.axes[0], "Test accuracy by scene", every, models, models, handles)


# Positions ----------------------------------------------------------------------------------------


def positions(record: Finished) -> np.ndarray:
    """Places along the line of contacts of a run on the scene ``spatial``: m [L]."""
    line = record.config["scene"]["classes"]
    return np.linspace(0.0, math.dist(line["start"], line["stop"]), line["number"])


def position_errors(record: Finished) -> np.ndarray:
    """Predicted minus true position of each test sample: m [Q]."""
    at = positions(record)
    return at[record.predicted] - at[record.test_labels]


@STUDY.figure(
    "fig7_spatial",
    caption="51 positions: correlations, confusion and error in millimetres (Fig. 7).",
    size=(WIDTH, 5.2),
    needs=lambda results: bool(results.group("spatial", "hdc").runs),
    commands=(f"{RUN}scenes", f"{RUN}spatial_correlation"),
)
def spatial(figure: Figure, results: Results) -> None:
    """Fig. 7 and the error in millimetres."""
    group, measured = results.group("spatial", "hdc"), results.measured("spatial_correlation")
    grid = figure.add_gridspec(3, 2, height_ratios=(1.4, 1, 1))
    left, right = (figure.add_subplot(grid[0, k]) for k in (0, 1))
    if measured is None:
        left.set_axis_off()
        left.text(0.5, 0.5, "no measurement\nspatial_correlation", ha="center", va="center")
    else:
        rows = measured.frame
        rows = rows[(rows["kind"] == "prototype") & (rows["samples"] == "held-out")]
        pairs = rows.groupby(["class_i", "class_j"], sort=False)["value"].mean().unstack(sort=False)
        matrix(left, pairs.to_numpy(float), [str(name) for name in pairs.index])
        left.set(xlabel="hypervectors of position (mm)", ylabel="prototype of position (mm)")
    panel(left, "a", "correlation $C^p$, held out")
    confusion(right, group)
    right.set(xlabel="predicted (mm)", ylabel="true position (mm)")
    panel(right, "b", "confusion (%)")
    at = 1e3 * positions(group.runs[0].record)
    truth = np.concatenate([run.record.test_labels for run in group.runs])
    error = 1e3 * np.abs(np.concatenate([position_errors(run.record) for run in group.runs]))
    n = np.bincount(truth, minlength=len(at))
    axes = figure.add_subplot(grid[1, :])
    axes.plot(at, np.bincount(truth, error, len(at)) / n, color="#0072B2", marker="o", ms=2)
    axes.set(xlabel="true position (mm)", ylim=(0, None), ylabel="mean |error| (mm)")
    panel(axes, "c", f"error against position, {n.min()} test samples each")
    axes = figure.add_subplot(grid[2, :])
    distances, counts = np.unique(error.round(6), return_counts=True)
    axes.vlines(distances, 1e-3, 100 * counts / len(error), color="#0072B2", lw=3)
    axes.set(xlabel="|error| (mm)", ylabel="test samples (%)", yscale="log")
    axes.set_ylim(50 / len(error), 150)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    values = error.mean(), *np.percentile(error, (50, 95))
    text = "mean {:.2f} mm\nmedian {:.3g} mm\n95th percentile {:.3g} mm".format(*values)
    axes.text(0.98, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=6)
    panel(axes, "d", f"distribution of the error, {len(error):,} test samples")
    frames = rows_of.frames_of([{"origin": group.runs[0].record.scene.origin}])
    head(
        figure, "HDC: 51 positions, 1 mm apart (Fig. 7)", [f"{frames}, {seeds_of(len(group.runs))}"]
    )


# Published numbers --------------------------------------------------------------------------------


@STUDY.quantities()
def quantities(results: Results) -> Iterator[Quantity]:
    """Accuracies of the finger, the positions and the objects, and errors in millimetres."""
    for scene in ("finger", "spatial", "tactile"):
        group = results.group(scene, "hdc")
        if group.runs:
            yield Quantity.of(
                f"{scene}/test_accuracy",
                estimates.share_of_one_sensor(group),
                ONE_SENSOR,
                100,
                n=len(group.right),
                seeds=len(group.runs),
                made_by=f"{RUN}scenes",
            )
    group = results.group("spatial", "hdc")
    errors = [1e3 * np.abs(position_errors(run.record)) for run in group.runs]
    summaries = {
        "mean": [error.mean() for error in errors],
        "median": [np.median(error) for error in errors],
        "p95": [np.percentile(error, 95) for error in errors],
    }
    for name, values in summaries.items() if errors else ():
        yield Quantity.of(
            f"spatial/{name}_position_error",
            estimates.one_sensor([float(value) for value in values]),
            ONE_SENSOR,
            n=sum(map(len, errors)),
            seeds=len(group.runs),
            made_by=f"{RUN}scenes",
        )
