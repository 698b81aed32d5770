"""Where HDC loses its points on recordings: one change of the model after the other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from experiments.records.results import once
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.plot import LETTERS, panel, wrapped
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import percent, points
from experiments.studies.recordings.values import (
    NOTE,
    Accuracies,
    accuracies_of,
    recordings,
    unsaturated,
)


class Step(NamedTuple):
    """One change, and the two models that differ by it."""

    name: str
    before: str
    after: str


STEPS = (
    Step("threshold: greys to bits", "ridge_standardised", "linear_bits"),
    Step("ridge to lda (4-bit weights)", "linear_bits", "hdc_lda"),
    Step("lda to class means: equal weights", "hdc_lda", "hdc_integer"),
    Step("mean to majority: one bit", "hdc_integer", "hdc"),
    Step("aside: prototype to nearest frame", "hdc", "nearest_neighbour"),
)
"""From ridge regression of grey values to HDC as published, and one step aside."""
# Blue for what wins, vermilion for losses: distinct in any colour vision.
GAIN, LOSS = "#0072B2", "#D55E00"
PANELS = 4  # in a row


@once
def decomposition(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording and step whose two models were asked, at the most frames."""
    found = unsaturated(recordings(frame))
    table = [
        {"recording": scene, **line}
        for scene, every in accuracies_of(found).items()
        for line in _steps(every)
    ]
    return pd.DataFrame(table)


def _steps(every: Accuracies) -> Iterator[dict[str, Any]]:
    for n in every.sizes[-1:]:
        for step in STEPS:
            # One of them may have been asked in fewer draws than the other.
            before, after = every.pair(step.before, step.after, n)
            if not len(before):
                continue
            yield {
                "n": n,
                "step": step.name,
                "before": step.before,
                "after": step.after,
                "before_accuracy": float(before.mean()),
                "after_accuracy": float(after.mean()),
                **every.difference(step.after, step.before, n).columns("change"),
            }


def waterfall(figure: Figure, frame: pd.DataFrame) -> None:
    """A panel per recording, a bar per step from the accuracy before to that after."""
    table = decomposition(frame)
    scenes = list(table.recording.unique())
    down = math.ceil(len(scenes) / PANELS)
    across = math.ceil(len(scenes) / down)  # rows as even as they can be
    figure.set_size_inches(7.0, 0.5 + 1.9 * down)
    panels = figure.subplots(down, across, sharey=True, squeeze=False).ravel()
    for unused in panels[len(scenes) :]:
        unused.set_visible(False)
    for letter, axes, scene in zip(LETTERS, panels, scenes, strict=False):
        rows = table[table.recording == scene]
        _bars(axes, rows)
        n = rows.n.iloc[0]
        panel(axes, letter, f"{wrapped(scene_name(scene), 24)}, n = {n}")
    names = [step.name for step in STEPS]
    for axes in panels[::across]:
        axes.set_yticks(range(len(STEPS)), names, fontsize=6)
    panels[0].set_ylim(len(STEPS) - 0.5, -0.5)


def _bars(axes: Axes, rows: pd.DataFrame) -> None:
    """Bars from the accuracy before to that after a step, joined by thin lines."""
    place = {step.name: k for k, step in enumerate(STEPS)}
    ends = []
    for row in rows.to_dict("records"):
        y = place[row["step"]]
        before, after = 100 * row["before_accuracy"], 100 * row["after_accuracy"]
        aside = y == len(STEPS) - 1
        axes.barh(
            y,
            after - before,
            left=before,
            height=0.6,
            color=GAIN if after >= before else LOSS,
            alpha=0.45 if aside else 0.85,
            hatch="////" if aside else None,
            edgecolor="white",
            lw=0.3,
        )
        right = max(before, after)
        if not math.isnan(row["change_low"]):
            low, high = (
                before + 100 * row["change_low"],
                before + 100 * row["change_high"],
            )
            axes.plot([low, high], [y, y], color="0.2", lw=0.8)
            right = max(right, high)
            ends += [low, high]
        if not aside:
            axes.plot([after, after], [y, y + 1], color="0.6", lw=0.5, zorder=0)
        # Beside the bar, or its interval where that is longer.
        text = f"  {points(row['change'])}"
        axes.text(right, y, text, va="center", fontsize=5.5)
        ends += [before, after]
    room = max(20.0, max(ends) - min(ends))
    # To the right there is room for numbers, but no accuracy above 100 %.
    left = min(100 - room, min(ends) - 0.1 * room)
    ticks = MaxNLocator(4).tick_values(left, min(100, max(ends) + 0.1 * room))
    axes.set_xticks([tick for tick in ticks if left <= tick <= 100])
    axes.set_xlim(left, max(ends) + 0.35 * room)
    axes.set_xlabel("accuracy (%)", fontsize=6)
    axes.grid(axis="x", color="0.92", lw=0.5)
    axes.set_axisbelow(True)


TABLES = [
    Table(
        "decomposition",
        decomposition,
        of="recordings",
        title="Where HDC loses its points: accuracy by one change of the model after the other",
        columns={
            "recording": Column("Recording", scene_name),
            "n": Column("Frames per class"),
            "step": Column("Step"),
            "before": Column("From", display_name),
            "after": Column("To", display_name),
            "before_accuracy": Column("From, %", percent),
            "after_accuracy": Column("To, %", percent),
            "change": Column("Change, points", points),
        },
        note=f"{NOTE} All steps are on the same bits but the first. The last one is aside: nearest "
        "neighbour keeps every training frame in place of one prototype per class.",
        key=("recording", "step"),
    )
]
FIGURES = [
    Plot(
        "decomposition",
        waterfall,
        of="recordings",
        caption="Where HDC loses its points, at the most frames per class: accuracy from "
        "ridge regression of grey values to HDC as published, one change of the "
        "model per row, one alternative hatched. Vermilion: points lost; blue: "
        "points won. Error bars: interval of a change.",
        size=(7.0, 4.2),
        needs=lambda frame: len(decomposition(frame)) > 0,
    )
]
