"""Every model on every scene: test errors, confusions, learning curves; Figs. 5(a), 6, 7 and 9.

Scenes of measured optics come before simulated ones.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator

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
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.plot import (
    CONFUSION_MAP,
    PRINTED,
    WIDTH,
    accuracy_curves,
    bars,
    handle,
    head,
    literal,
    matrix,
    measured_models,
    panel,
    plain_decades,
    seeds_of,
    title,
)
from experiments.reporting.rows import Row, row
from experiments.reporting.study import RUN, Quantity, Study, with_places
from experiments.reporting.table import frame
from experiments.reporting.text import frames_of
from experiments.studies.correlation.view import matrices

EXPERIMENT = "all_scenes"
BY_STEPS = ("softmax", "cnn1_fast")  # iterative models, run where an epoch is short
SPATIAL_CORRELATION = (
    f"{RUN}correlation scene=spatial 'task.kinds=[prototype]' 'task.samples=[held-out]'"
)
LETTERS = "abcdefghijklmnopqrstuvwxyz"
# Which figure of the paper shows the confusion of a scene.
PAPER = {
    "touch": "Fig. 5(a)",
    "finger": "Fig. 6(b)",
    "spatial": "Fig. 7(b)",
    "tactile": "Fig. 9(d)",
}
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


def by_scene(lines: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by scene."""
    scenes: dict[str, list[Row]] = {}
    for line in lines:
        scenes.setdefault(line["scene"], []).append(line)
    return scenes


def few_samples(results: Results) -> list[Row]:
    """Rows of models that were run with several N; touch has a study of its own."""
    every = [g for g in results.groups() if g.pixels is None and g.runs and g.scene != "touch"]
    several = Counter((group.scene, group.model) for group in every)
    return [
        row(group, results.group(group.scene, "hdc", group.n_train))
        for group in every
        if several[group.scene, group.model] > 1
    ]


def grid(figure: Figure, n: int, height: float, columns: int = 2) -> list[Axes]:
    """Axes of so many panels, and the figure as high as they need."""
    lines = -(-n // columns)
    figure.set_size_inches(WIDTH, 1.4 + height * lines)
    return [figure.add_subplot(lines, columns, k + 1) for k in range(n)]


@STUDY.table(
    EXPERIMENT,
    title="Every model on every scene",
    note="Fibre: frames computed from measured transmission matrices. Each model on all pixels of "
    "a scene and the most training samples that it was given.",
    shown=(
        "scene", "origin", "model", "seeds", "test_accuracy_final", "over_hdc", "training_time_s",
        "training_time_over_hdc", "predict_single_s", "model_bytes", "status",
    ),
)  # fmt: skip
def all_scenes(results: Results) -> pd.DataFrame:
    """One row a scene and model."""
    data = frame(lines_of(results))
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
    scenes = by_scene(
        line
        for line in lines_of(results)
        if line["model"] in models or line["model"] in results.extra_models(line["scene"])
    )
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
        accuracy = [line[f"test_accuracy_final{end}"] for end in ("", "_high", "_low")]
        error, low, high = 100 - 100 * np.array(accuracy)
        reached = not isinstance(line["training_time_s"], str)
        time = line["training_time_s"] if reached else line["total_time_s"]
        spread = np.maximum([[error - low], [high - error]], 0)
        alpha = 1.0 if reached else 0.4
        bars(axes, line["model"], time, error, spread, ms=4, lw=0.7, capsize=1.2, alpha=alpha)
        largest = max(largest, error)
    axes.set_ylim(-0.03 * max(5.0, 1.5 * largest), max(5.0, 1.5 * largest))
    plain_decades(axes)
    # A panel may span less than a decade, which would have one label, or all of them.
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(axis="x", labelsize=6)


# Confusions ---------------------------------------------------------------------------------------


@STUDY.figure(
    "confusions",
    caption="Confusion of the classes by HDC, in percent of the true label (rows), test samples of "
    "all seeds together (Figs. 5(a), 6(b) and 9(d)); less than 0.5 % is left blank.",
    needs=lambda results: bool(confused(results)),
    commands=(f"{RUN}scenes", f"{RUN}{EXPERIMENT}"),
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
        by = "" if name == "hdc" else f"{display_name(name)}, "
        accuracy = 100 * estimates.share(group).value
        scene = textwrap.fill(literal(group.scene.replace("_", " ")), 17)
        panel(axes, letter, f"{scene}{of}\n{by}{accuracy:.1f} %")
    frames = frames_of([{"origin": g.runs[0].record.scene.origin} for g in chosen])
    head(figure, "Confusion by HDC, % of the true label", [frames])


def confused(results: Results) -> list[Group]:
    """HDC's runs on each scene of few classes; where it was not run, the first model's."""
    first: dict[str, Group] = {}
    for group in groups(results):
        if len(group.classes) <= PRINTED:
            first.setdefault(group.scene, group)
    return list(first.values())


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
    every = few_samples(results)
    scenes = by_scene(every)
    models = measured_models(every, [line["model"] for line in every])
    panels = grid(figure, len(scenes), 2.1, columns=1)
    for axes, letter, (scene, lines) in zip(panels, LETTERS, scenes.items(), strict=False):
        accuracy_curves(axes, lines, models, "n_train")
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_major_locator(FixedLocator([5, 10, 20, 50, 100, 200, 400, 1000, 4000]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel("training samples N")
        panel(axes, letter, literal(scene))
    handles = [handle(model) for model in models]
    title(figure, figure.axes[0], "Test accuracy by scene", every, models, models, handles)


# Positions ----------------------------------------------------------------------------------------


def positions(record: Finished) -> np.ndarray:
    """Places along the line of contacts of a run on the scene ``spatial``: mm [L]."""
    line = record.config["scene"]["classes"]
    return np.linspace(0.0, 1e3 * math.dist(line["start"], line["stop"]), line["number"])


@STUDY.figure(
    "fig7_spatial",
    caption="51 positions: correlations, confusion and error in millimetres (Fig. 7).",
    size=(WIDTH, 3.9),
    needs=lambda results: bool(results.group("spatial", "hdc").runs),
    commands=(f"{RUN}scenes", SPATIAL_CORRELATION),
)
def spatial(figure: Figure, results: Results) -> None:
    """Fig. 7 and the error in millimetres."""
    group, measured = results.group("spatial", "hdc"), dict(with_places(results, "correlation"))
    grid = figure.add_gridspec(2, 2, height_ratios=(1.4, 1))
    left, right, below = (figure.add_subplot(grid[at]) for at in ((0, 0), (0, 1), (1, slice(None))))
    if "_spatial" in measured:
        classes, values, _ = matrices(measured["_spatial"].frame, "prototype", "held-out")
        matrix(left, values.mean(0), classes)
        left.set(xlabel="hypervectors of position (mm)", ylabel="prototype of position (mm)")
    else:
        left.set_axis_off()
    panel(left, "a", "correlation $C^p$, held out" if left.axison else "no measurement")
    confusion(right, group)
    right.set(xlabel="predicted (mm)", ylabel="true position (mm)")
    panel(right, "b", "confusion (%)")
    at = positions(group.runs[0].record)
    truth = np.concatenate([run.record.test_labels for run in group.runs])
    error = np.abs(at[np.concatenate([run.record.predicted for run in group.runs])] - at[truth])
    mean = np.bincount(truth, error, len(at)) / np.bincount(truth, minlength=len(at))
    below.plot(at, mean, color="#0072B2", marker="o", ms=2)
    below.set(xlabel="true position (mm)", ylim=(0, None), ylabel="mean |error| (mm)")
    text = "mean {:.2f} mm, median {:.3g} mm, 95th percentile {:.3g} mm"
    panel(below, "c", text.format(error.mean(), *np.percentile(error, (50, 95))))
    frames = frames_of([{"origin": group.runs[0].record.scene.origin}])
    details = [f"{frames}, {seeds_of(len(group.runs))}"]
    head(figure, "HDC: 51 positions, 1 mm apart (Fig. 7)", details)


# Published numbers --------------------------------------------------------------------------------


@STUDY.quantities()
def quantities(results: Results) -> Iterator[Quantity]:
    """Accuracies of the finger, the positions and the objects."""
    for scene in ("finger", "spatial", "tactile"):
        group = results.group(scene, "hdc")
        if group.runs:
            share, n = estimates.share_of_one_sensor(group), len(group.right)
            rest = {"n": n, "seeds": len(group.runs), "made_by": f"{RUN}scenes"}
            yield Quantity.of(f"{scene}/test_accuracy", share, ONE_SENSOR, 100, **rest)
