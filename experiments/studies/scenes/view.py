"""Every scene that runs saw: its table, its learning curve, its confusions; Figs. 5(a), 6, 7, 9."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import partial
from hashlib import sha256

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter

from experiments.records.record import Record
from experiments.records.results import Group, Results
from experiments.reporting import published
from experiments.reporting import rows as rows_of
from experiments.reporting.estimates import (
    ONE_SENSOR,
    one_sensor,
    share,
    share_of_one_sensor,
)
from experiments.reporting.plot import (
    CONFUSION_MAP,
    PRINTED,
    STYLE,
    WIDTH,
    accuracy_curves,
    handle,
    head,
    literal,
    matrix,
    measured_models,
    panel,
    seeds_of,
    title,
)
from experiments.reporting.rows import VALUES, Row, columns, display_name, row
from experiments.reporting.study import RUN, Plot, Quantity, Study
from experiments.reporting.table import Table, frame
from experiments.studies.correlation.view import matrices

# Which figure of the paper shows a scene, and the line of published.csv that has its accuracy.
PAPER = {
    "touch": ("Fig. 5(a)", "table1/hdc_test_accuracy", "labels of touch"),
    "finger": ("Fig. 6(b)", "finger/test_accuracy", "labels touched by a finger"),
    "spatial": ("Fig. 7(b)", "spatial/test_accuracy", "positions"),
    "tactile": ("Fig. 9(d)", "tactile/test_accuracy", "objects"),
}
_COLUMNS = columns(
    "Model",
    "N",
    "Seeds",
    "Training time, s",
    "Until it stopped, s",
    "× HDC",
    "Training accuracy, %",
    "Test accuracy, %, maximum",
    "Test accuracy, %, final [95 %]",
    "− HDC, points [95 %]",
    "Seeds above, below HDC",
    "Prediction, ms a frame",
    "Size",
    "Status",
)
_NAMES = {"touch": "fig5_confusion", "finger": "fig6_confusion", "tactile": "fig9_confusion"}


def tables(results: Results) -> Iterator[Table]:
    """A table a scene: every model, on all its pixels and all its training samples."""
    for scene in results.scenes:
        groups = _largest(results, scene)
        lines = [row(group, results.group(scene, "hdc", group.n_train)) for group in groups]
        if lines:
            yield Table(
                f"scene_{stem(scene)}",
                rows_of.caption(lines, "Every model"),
                frame(lines, VALUES),
                _COLUMNS,
                rows_of.notes(lines, _COLUMNS),
                rows_of.commands(groups),
            )


def plots(results: Results) -> Iterator[Plot]:
    """Confusions by HDC, or by the first model where HDC was not run; a learning curve."""
    for scene in results.scenes:
        groups = {group.model: group for group in _largest(results, scene)}
        first = "hdc" if "hdc" in groups else next(iter(groups), "")
        for model in dict.fromkeys([first, *results.extra_models(scene)]):
            if model not in groups or (scene, model) == ("spatial", "hdc"):
                continue
            name = _NAMES.get(scene, f"confusion_{stem(scene)}")
            yield Plot(
                name if model == first else f"{name}_{stem(model)}",
                f"Confusion matrix of {display_name(model)} on the scene “{scene}”"
                + (f" ({PAPER[scene][0]})." if scene in PAPER else "."),
                partial(confusion, groups[model]),
                rows_of.commands([groups[model]]),
            )
        if (scene, first) == ("spatial", "hdc"):
            yield Plot(
                "fig7_spatial",
                "51 positions: correlations, confusion and error in millimetres (Fig. 7).",
                partial(spatial, results),
                [f"{RUN}scenes", f"{RUN}spatial_correlation"],
            )
        few = _groups(results, scene)
        # On touch it is a study of its own.
        if scene != "touch" and len({group.n_train for group in few}) > 1:
            yield Plot(
                f"accuracy_vs_n_{stem(scene)}",
                f"Test accuracy against the number of training samples on the scene “{scene}”.",
                partial(learning_curve, results, scene),
                rows_of.commands(few),
            )


def quantities(results: Results) -> Iterator[Quantity]:
    """Accuracies of the finger, the positions and the objects, and errors in millimetres."""
    for scene in ("finger", "spatial", "tactile"):
        group = results.group(scene, "hdc")
        if group.runs:
            yield Quantity.of(
                f"{scene}/test_accuracy",
                share_of_one_sensor(group),
                ONE_SENSOR,
                100,
                n=len(group.right),
                seeds=len(group.runs),
                made_by=f"{RUN}scenes",
            )
    group = results.group("spatial", "hdc")
    if group.runs:
        errors = [1e3 * np.abs(position_errors(run.record)) for run in group.runs]
        for name, of in (
            ("mean", np.mean),
            ("median", np.median),
            ("p95", lambda e: np.percentile(e, 95)),
        ):
            found = one_sensor([float(of(e)) for e in errors])
            yield Quantity.of(
                f"spatial/{name}_position_error",
                found,
                ONE_SENSOR,
                n=sum(map(len, errors)),
                seeds=len(group.runs),
                made_by=f"{RUN}scenes",
            )


def stem(scene: str) -> str:
    """A scene's name as part of a file's."""
    name = re.sub(r"\W+", "_", scene).strip("_")
    # Two names that are cut must not become one.
    return name if len(name) <= 60 else f"{name[:50]}_{sha256(scene.encode()).hexdigest()[:8]}"


def confusion(group: Group) -> Figure:
    """Confusion matrix of a row, the test samples of all seeds together."""
    with plt.rc_context(STYLE):
        n_classes = len(group.classes)
        height = 2.9 if n_classes > 5 else 2.6
        figure, axes = plt.subplots(figsize=(WIDTH, height), layout="constrained")
        _confusion(axes, group)
        other = "", "", f"classes of {literal(group.scene)}"
        figure_of_paper, _, what = PAPER.get(group.scene, other)
        of = f" ({figure_of_paper})" if figure_of_paper else ""
        head(
            figure,
            f"{literal(display_name(group.model))}: confusion of {n_classes} {what}{of}",
            _details(group),
        )
    return figure


def learning_curve(results: Results, scene: str) -> Figure:
    """Accuracy against the number of training samples, of every model that ran on the scene."""
    lines: list[Row] = [
        row(group, results.group(scene, "hdc", group.n_train)) for group in _groups(results, scene)
    ]
    models = measured_models(lines, [line["model"] for line in lines])
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.2))
        accuracy_curves(axes, lines, models, "n_train")
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.set_xticks(sorted({line["n_train"] for line in lines}))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel("training samples N")
        title(
            figure,
            axes,
            f"Test accuracy on the scene “{literal(scene)}”",
            lines,
            models,
            models,
            [handle(model) for model in models],
        )
    return figure


def spatial(results: Results) -> Figure:
    """Fig. 7 and the error in millimetres."""
    group, measured = results.group("spatial", "hdc"), results.measured("spatial_correlation")
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(WIDTH, 5.2), layout="constrained")
        grid = figure.add_gridspec(3, 2, height_ratios=(1.4, 1, 1))
        left, right = (figure.add_subplot(grid[0, k]) for k in (0, 1))
        details = _details(group)
        if measured is None:
            left.set_axis_off()
            left.text(0.5, 0.5, "no measurement\nspatial_correlation", ha="center", va="center")
        else:
            names, values, n = matrices(measured, "prototype", "held-out")
            matrix(left, values.mean(0), names)
            left.set_ylabel("prototype of position (mm)")
            left.set_xlabel("hypervectors of position (mm)")
            details.append(
                f"(a) mean over {seeds_of(len(values))} and {n} held-out samples a position"
            )
        panel(left, "a", "correlation $C^p$")
        _confusion(right, group)
        right.set(xlabel="predicted (mm)", ylabel="true position (mm)")
        panel(right, "b", "confusion")
        _error_over_position(figure.add_subplot(grid[1, :]), group)
        _error_distribution(figure.add_subplot(grid[2, :]), group)
        head(figure, "HDC: 51 positions, 1 mm apart (Fig. 7)", details)
    return figure


def positions(record: Record) -> np.ndarray:
    """Places along the line of contacts of a run on the scene ``spatial``: m [L]."""
    line = record.config["scene"]["classes"]
    return np.linspace(0.0, math.dist(line["start"], line["stop"]), line["number"])


def position_errors(record: Record) -> np.ndarray:
    """Predicted minus true position of each test sample: m [Q]."""
    at = positions(record)
    return at[record.predicted] - at[record.test_labels]  # type: ignore[attr-defined]


def _groups(results: Results, scene: str) -> list[Group]:
    """Rows of a scene that saw all pixels, in the order of their models."""
    return [g for g in results.groups() if g.scene == scene and g.pixels is None]


def _largest(results: Results, scene: str) -> list[Group]:
    """The row of each model with all training samples, or the most it was given."""
    found: dict[str, list[Group]] = {}
    for group in _groups(results, scene):
        found.setdefault(group.model, []).append(group)
    return [max(same, key=lambda g: g.n_train or math.inf) for same in found.values()]


def _confusion(axes: Axes, group: Group) -> None:
    """Shares of each row in percent; zeros are left blank."""
    counts = group.confusion()
    shares = 100 * counts / np.maximum(counts.sum(1, keepdims=True), 1)
    small = len(group.classes) <= PRINTED
    cells = [[_cell(value) for value in line] for line in shares] if small else None
    gamma = 1 if small else 0.4  # a colour has to show one of 100 test samples
    label = "% of the true label"
    bar = matrix(axes, shares, group.classes, cells, CONFUSION_MAP, (0, 100), gamma, label)
    bar.set_ticks([0, 20, 40, 60, 80, 100] if small else [0, 5, 20, 50, 100])
    axes.set(xlabel="predicted", ylabel="true label")


def _cell(percent: float) -> str:
    return "" if percent == 0 else f"{percent:.1f}".removesuffix(".0")


def _details(group: Group) -> list[str]:
    """Origin, samples, accuracy and the paper's."""
    value, low, high = (100 * part for part in share(group))
    record = group.runs[0].record
    frames = rows_of.frames_of([{"origin": record.scene.origin}])
    known = PAPER.get(group.scene)
    paper = f"; paper {100 * (published.value(known[1]) or 0):.3g} %" if known else ""
    return [
        f"{frames}, {seeds_of(len(group.runs))}, {record.n_train} training, {record.n_test} test "
        "samples each",
        f"accuracy {value:.1f} % [{low:.1f}, {high:.1f}] (95 %){paper}",
    ]


def _error_over_position(axes: Axes, group: Group) -> None:
    """Mean error at each true position, and the share of wrong predictions."""
    at = 1e3 * positions(group.runs[0].record)
    truth = np.concatenate([run.record.test_labels for run in group.runs])
    error = 1e3 * np.abs(np.concatenate([position_errors(run.record) for run in group.runs]))
    n = np.bincount(truth, minlength=len(at))
    mean = np.bincount(truth, error, len(at)) / n
    wrong = 100 * np.bincount(truth, error > 0, len(at)) / n
    axes.plot(at, mean, color="#0072B2", marker="o", ms=2)
    axes.set(xlabel="true position (mm)", ylim=(0, None), xlim=(-1, at[-1] + 1))
    axes.set_ylabel("mean |error| (mm)", color="#0072B2")
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.plot(at, wrong, color="#D55E00", marker="s", ms=2, ls=":")
    other.set_ylim(0, None)
    other.set_ylabel("wrong (%)", color="#D55E00")
    panel(axes, "c", f"error against position, {n.min()} test samples each")


def _error_distribution(axes: Axes, group: Group) -> None:
    """How many predictions are how far off."""
    error = 1e3 * np.abs(np.concatenate([position_errors(run.record) for run in group.runs]))
    spacing = 1e3 * np.diff(positions(group.runs[0].record))[0]
    steps = np.rint(error / spacing).astype(int)
    shares = 100 * np.bincount(steps) / len(steps)
    shown = np.flatnonzero(shares)
    axes.vlines(shown * spacing, 1e-2, shares[shown], color="#0072B2", lw=3)
    axes.set_yscale("log")
    axes.set(xlabel="|error| (mm)", ylabel="test samples (%)", ylim=(50 / len(steps), 150))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    numbers = [error.mean(), *np.percentile(error, (50, 95))]
    text = "mean {:.2f} mm\nmedian {:.3g} mm\n95th percentile {:.3g} mm".format(*numbers)
    axes.text(0.98, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=6)
    panel(axes, "d", f"distribution of the error, {len(error):,} test samples")


STUDY = Study(
    "scenes",
    "Every scene",
    "How do the models do on every scene that was run, recordings of one's own included?",
    3,
    tables,
    plots,
    quantities,
)
