"""Every model on each recording as a figure, and how far its classes lie apart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.results import Results
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.curves import errors
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import commands_of
from experiments.reporting.plot import LETTERS, head, literal, panel, wrapped
from experiments.reporting.study import RUN
from experiments.reporting.text import number
from experiments.studies.recordings.panels import grid
from experiments.studies.recordings.study import STUDY
from experiments.studies.recordings.values import (
    Accuracies,
    accuracies_of,
    recordings,
    unsaturated,
)

# Frames per class that the figure shows, with colour and marker.
SIZES = {
    1: ("#56B4E9", "o"),
    5: ("#0072B2", "s"),
    20: ("#E69F00", "D"),
    50: ("black", "^"),
}


def _chart(results: Results) -> dict[str, Any]:
    """The interactive form: accuracy against the frames of each class, a panel a recording."""
    from experiments.reporting.page.charts import accuracy_chart  # slow to load

    lines = []
    for scene, measured in unsaturated(recordings(results)).items():
        every = Accuracies(measured)
        for model, n in itertools.product(every.models, every.sizes):
            found = every.mean(model, n)
            if not math.isnan(found.value):
                line = {"scene": scene_name(scene), "model": model, "n": n}
                shown = Estimate(*(round(100 * bound, 2) for bound in found))
                command = f"{RUN}recordings scene={scene}"
                lines.append(line | shown.columns("accuracy") | {"command": command})
    return accuracy_chart(pd.DataFrame(lines), "n", "training frames of each class")


@STUDY.figure(
    "recordings",
    caption="Accuracy of every model on each public recording that is not saturated, by the "
    "number of training frames per class. Grey band: HDC; dashed: chance. Models are in the order "
    "of their mean at the most frames; without a marker: not measured. Split by time, group or "
    "position; bars: 95 %.",
    size=(7.0, 4.0),
    needs=lambda results: bool(unsaturated(recordings(results))),
    commands=lambda results: commands_of(unsaturated(recordings(results)).values()),
    chart=_chart,
)
def every_model(figure: Figure, results: Results) -> None:
    """A panel per recording, a line per model, a marker per number of frames."""
    found = unsaturated(recordings(results))
    every = accuracies_of(found)
    models = _by_mean(every.values())
    row = 0.6 + 0.105 * len(models)
    panels, at_the_left = grid(figure, len(found), row, rest=0.8, sharey=True)
    for letter, axes, scene in zip(LETTERS, panels, found, strict=False):
        _frame_of_panel(axes, models, _chance(found[scene].frame))
        _draw_accuracies(axes, models, every[scene])
        panel(axes, letter, wrapped(scene_name(scene), 26))
    names = [literal(display_name(model)) for model in models]
    for axes in at_the_left:
        axes.set_yticks(range(len(models)), names)
        for label, model in zip(axes.get_yticklabels(), models, strict=True):
            weight = "bold" if model == "hdc" else "normal"
            label.set(fontsize=6, fontweight=weight)
    handles = [
        Line2D([], [], color=colour, marker=marker, ls="", ms=3, label=str(n))
        for n, (colour, marker) in SIZES.items()
    ]
    where: Any = {"loc": "outside lower center", "ncols": len(SIZES)}
    figure.legend(handles=handles, title="frames per class", **where)


def _draw_accuracies(axes: Axes, models: Sequence[str], every: Accuracies) -> None:
    """A marker for each number of frames in the line of each model."""
    for n, (colour, marker) in SIZES.items():
        asked = [model for model in models if len(every.of(model, n))]
        x, spread = errors([every.mean(model, n) for model in asked], 100)
        axes.errorbar(
            x,
            [models.index(model) for model in asked],
            xerr=np.maximum(spread, 0),
            elinewidth=0.5,
            color=colour,
            marker=marker,
            ls="",
            ms=2.6,
        )


def _by_mean(every: Iterable[Accuracies]) -> list[str]:
    """Models, the least accurate first, by their mean over recordings at the most frames."""
    table: dict[str, list[float]] = {}
    for of_scene in every:
        if not of_scene.sizes:  # nothing by the split that counts
            continue
        for model in of_scene.models:
            values = table.setdefault(model, [])
            most = of_scene.mean(model, of_scene.sizes[-1]).value
            if not np.isnan(most):
                values.append(most)
    return sorted(table, key=lambda model: float(np.mean(table[model] or [0])))


def _chance(rows: pd.DataFrame) -> float | None:
    """Accuracy of guessing, in percent; None where the rows do not have the number of classes."""
    return 100 / rows.n_classes.iloc[0] if "n_classes" in rows else None


def _frame_of_panel(
    axes: Axes,
    models: Sequence[str],
    chance: float | None,
) -> None:
    """Axis, lines of the models, the band of HDC and the dashed line of chance."""
    axes.set(xlim=(0, 103), ylim=(-0.7, len(models) - 0.3))
    axes.set_xticks([0, 50, 100])
    axes.set_xlabel("accuracy (%)", fontsize=6)
    axes.set_yticks(range(len(models)))
    axes.grid(axis="y", color="0.92", lw=0.5)
    axes.set_axisbelow(True)
    if "hdc" in models:
        at = models.index("hdc")
        axes.axhspan(
            at - 0.5,
            at + 0.5,
            color="0.88",
            lw=0,
            zorder=0,
        )
    if chance is not None:
        axes.axvline(
            chance,
            color="0.4",
            lw=0.7,
            ls="--",
            zorder=0,
        )


@STUDY.figure(
    "recording_distances",
    caption="Hamming distances between hypervectors of frames of one class (intra) and of two "
    "(inter), and their separation d′. Unrelated frames differ in half of their pixels. Each "
    "panel has a vertical scale of its own.",
    size=(7.0, 2.6),
    needs=lambda results: bool(recordings(results, "recording_distances")),
    commands=lambda results: commands_of(
        recordings(results, "recording_distances").values()
    ),
)
def distances(figure: Figure, results: Results) -> None:
    """Histograms of intra- and inter-class distances, a panel a recording."""
    shown = recordings(results, "recording_distances")
    panels = figure.subplots(
        1,
        len(shown),
        squeeze=False,
        sharex=True,
    )[0]
    colours = {"intra": "#0072B2", "inter": "#D55E00"}
    for letter, axes, scene in zip(LETTERS, panels, shown, strict=False):
        measured = shown[scene]
        for kind, colour in colours.items():
            part = measured.frame.query("kind == @kind")
            counts = part.groupby("low")["count"].sum()
            look = {"color": colour, "lw": 0.9, "label": kind}
            axes.step(
                counts.index,
                counts / counts.sum(),
                where="post",
                **look,
            )
        separated = number(separation(measured.frame), 2)
        panel(axes, letter, f"{wrapped(scene_name(scene), 22)}\nd′ = {separated}")
        axes.set_yticks([])
        axes.set_xlabel("share of bits that differ", fontsize=6)
    panels[0].set_ylabel("share of pairs", fontsize=6)
    panels[0].legend()
    head(figure, "Hamming distances between frames of one class and of two", [])


def separation(rows: pd.DataFrame) -> float:
    """d′ = |mean inter − mean intra| / √((variance inter + variance intra)/2)."""
    moments = rows.groupby("kind")[["mean", "variance"]].mean()
    means, variances = moments["mean"], moments["variance"]
    gap = abs(means["inter"] - means["intra"])
    return float(gap / np.sqrt(variances.mean()))
