"""Confusion matrices of any scene (Figs. 5(a), 6(b), 9(d)), and the 51 positions (Fig. 7)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments import evaluate
from experiments.figures import STYLE, WIDTH
from experiments.paper_data import (
    confusion_of,
    finished,
    matrices,
    position_errors,
    positions,
    right_of,
)
from experiments.paper_style import CONFUSION_MAP, PRINTED, changed, head, matrix, panel, seeds_of
from experiments.selection import Group, Records
from experiments.table_text import display_name
from experiments.tables import published

# Which figure of the paper shows a scene, and the line of published.csv that has its accuracy.
PAPER = {
    "touch": ("Fig. 5(a)", "table1/hdc_test_accuracy", "labels of touch"),
    "finger": ("Fig. 6(b)", "finger/test_accuracy", "labels touched by a finger"),
    "spatial": ("Fig. 7(b)", "spatial/test_accuracy", "positions"),
    "tactile": ("Fig. 9(d)", "tactile/test_accuracy", "objects"),
}


def confusion(records: Records, scene: str, model: str = "hdc") -> Figure | None:
    """Confusion matrix of a scene, the test samples of all seeds together; None without a run."""
    group = records.group(scene, model)
    if not group.runs:
        return None
    with plt.rc_context(STYLE):
        n_classes = len(group.runs[0].record["scene"]["classes"])
        height = 2.9 if n_classes > 5 else 2.6
        figure, axes = plt.subplots(figsize=(WIDTH, height), layout="constrained")
        _confusion(axes, group)
        figure_of_paper, _, what = PAPER.get(scene, ("", "", scene))
        of = f" ({figure_of_paper})" if figure_of_paper else ""
        head(figure, f"{display_name(model)}: confusion of {n_classes} {what}{of}",
             [*_details(group), *changed(group)])  # fmt: skip
    return figure


def spatial(records: Records, results: Path) -> Figure | None:
    """Fig. 7 and the error in millimetres; None without a run."""
    group = records.group("spatial", "hdc")
    if not group.runs:
        return None
    measured = finished(results, "spatial_correlation")
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
        details += changed(group) + (changed(measured) if measured else [])
        head(figure, "HDC: 51 positions, 1 mm apart (Fig. 7)", details)
    return figure


def _confusion(axes: Axes, group: Group) -> None:
    """Shares of each row in percent; zeros are left blank."""
    classes, counts = confusion_of(group)
    share = 100 * counts / np.maximum(counts.sum(1, keepdims=True), 1)
    small = len(classes) <= PRINTED
    cells = [[_cell(value) for value in row] for row in share] if small else None
    gamma = 1 if small else 0.4  # a colour has to show one of 100 test samples
    label = "% of the true label"
    bar = matrix(axes, share, classes, cells, CONFUSION_MAP, (0, 100), gamma, label)
    bar.set_ticks([0, 20, 40, 60, 80, 100] if small else [0, 5, 20, 50, 100])
    axes.set(xlabel="predicted", ylabel="true label")


def _cell(percent: float) -> str:
    return "" if percent == 0 else f"{percent:.1f}".removesuffix(".0")


def _details(group: Group) -> list[str]:
    """Origin, samples, accuracy and the paper's."""
    right, n_test = right_of(group)
    low, high = evaluate.wilson(right, n_test)
    record = group.runs[0].record
    known = PAPER.get(group.scene)
    paper = f"; paper {100 * published()[known[1]]:.3g} %" if known else ""
    return [
        f"{record['scene']['origin']} frames, {seeds_of(len(group.runs))}, {record['n_train']} "
        f"training, {record['n_test']} test samples each",
        f"accuracy {100 * right / n_test:.1f} % [{100 * low:.1f}, {100 * high:.1f}] (95 %){paper}",
    ]


def _error_over_position(axes: Axes, group: Group) -> None:
    """Mean error at each true position, and the share of wrong predictions."""
    record = group.runs[0].record
    at = 1e3 * positions(record)
    truth = np.concatenate([run.record["test_labels"] for run in group.runs])
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
    share = 100 * np.bincount(steps) / len(steps)
    shown = np.flatnonzero(share)
    axes.vlines(shown * spacing, 1e-2, share[shown], color="#0072B2", lw=3)
    axes.set_yscale("log")
    axes.set(xlabel="|error| (mm)", ylabel="test samples (%)", ylim=(50 / len(steps), 150))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    numbers = [error.mean(), *np.percentile(error, (50, 95))]
    text = "mean {:.2f} mm\nmedian {:.3g} mm\n95th percentile {:.3g} mm".format(*numbers)
    axes.text(0.98, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=6)
    panel(axes, "d", f"distribution of the error, {len(error):,} test samples")
