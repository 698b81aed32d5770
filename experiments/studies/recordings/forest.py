"""The answer in one picture: HDC as published and extended beside its baseline, by recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import RIVAL, place_of
from experiments.reporting.plot import head, literal, panel
from experiments.reporting.study import RUN, Plot
from experiments.reporting.text import CAPTURED, COMPUTED, SIMULATED
from experiments.studies.recordings.values import (
    CONFIRMATORY,
    FEW,
    RIVALS,
    SPLIT,
    accuracies_of,
    gaps,
    kind,
    recordings,
    unsaturated,
)

WIDTH = 5.4  # in; narrow, so that its letters can be read on a phone
MARGIN = 3  # points, within which two models count as equally good
HEADINGS = (CAPTURED, COMPUTED, SIMULATED)
# Look of each form: told apart by marker and fill as well as by colour.
LOOKS: dict[str, dict[str, Any]] = {
    "hdc": {"color": "#D55E00", "marker": "o", "mfc": "white"},
    "hdc_levels_lda": {"color": "#0072B2", "marker": "D"},
}
NAMES = {"hdc": "HDC, published", "hdc_levels_lda": "HDC, extended (levels, LDA)"}


class Dot(NamedTuple):
    """A form minus the baseline on one recording, in one panel."""

    scene: str
    kind: str
    form: str
    few: bool
    difference: Estimate


def dots(frame: pd.DataFrame) -> list[Dot]:
    """Every form and size that was measured."""
    return list(_dots(frame))


def _dots(frame: pd.DataFrame) -> Iterator[Dot]:
    found = unsaturated(recordings(frame))
    for scene, every in accuracies_of(found).items():
        of_kind = kind(scene, found[scene])
        if not every.sizes:
            continue
        for n, few in ((FEW, True), (every.sizes[-1], False)):
            for gap in gaps(every, n, CONFIRMATORY, RIVALS):
                yield Dot(scene, of_kind, gap.form, few, gap.difference)


def forest(figure: Figure, frame: pd.DataFrame) -> None:
    """Two panels: five frames per class, and the most."""
    every = dots(frame)
    rows = _rows(every)
    figure.set_size_inches(WIDTH, 1.2 + 0.22 * len(rows))
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    titles = (f"{FEW} frames per class", "the most frames per class")
    for axes, letter, title, few in zip(
        panels, "ab", titles, (True, False), strict=True
    ):
        _frame(axes, rows)
        for dot in every:
            if dot.few == few:
                _draw(axes, dot, rows.index((dot.kind, dot.scene)))
        shown = {dot.scene for dot in every if dot.few == few}
        _tell_blank(axes, rows, shown)
        panel(axes, letter, title)
        axes.set_title(axes.get_title(loc="left"), loc="left", fontsize=8)
    _label(panels[0], rows)
    handles: list[Any] = [
        Line2D([], [], ls="", ms=5, label=NAMES[form], **LOOKS[form])
        for form in CONFIRMATORY
        if form in {dot.form for dot in every}
    ]
    handles.append(Patch(color="0.88", label=f"±{MARGIN:g} points"))
    where: Any = {"loc": "outside lower center", "ncols": 3, "fontsize": 8}
    figure.legend(handles=handles, **where)
    head(figure, "Accuracy of HDC minus that of softmax, by recording", [SPLIT])


def _rows(every: list[Dot]) -> list[tuple[str, str]]:
    """Kind and scene of each row from top to bottom; a heading has no scene."""
    rows = []
    for of_kind in HEADINGS:
        scenes = {dot.scene for dot in every if dot.kind == of_kind}
        if scenes:
            rows.append((of_kind, ""))
            ordered = sorted(scenes, key=lambda scene: (place_of(scene), scene))
            rows += [(of_kind, scene) for scene in ordered]
    return rows


def _frame(axes: Axes, rows: list[tuple[str, str]]) -> None:
    axes.axvspan(-MARGIN, MARGIN, color="0.88", lw=0, zorder=0)
    axes.axvline(0, color="0.4", lw=0.7, zorder=1)
    for y, (_, scene) in enumerate(rows):
        if scene:
            axes.axhline(y, color="0.93", lw=0.5, zorder=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("HDC minus softmax (points)", fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _label(axes: Axes, rows: list[tuple[str, str]]) -> None:
    names = []
    for of_kind, scene in rows:
        if not scene:
            names.append(of_kind)
        else:
            names.append(literal(scene_name(scene)))
    axes.set_yticks(range(len(rows)), names)
    labels = axes.get_yticklabels()
    for label, (_, scene) in zip(labels, rows, strict=True):
        label.set_fontsize(8)
        if not scene:
            label.set_fontweight("bold")


def _tell_blank(axes: Axes, rows: list[tuple[str, str]], shown: set[str]) -> None:
    """Say of each row without a dot that nothing was measured."""
    for y, (_, scene) in enumerate(rows):
        if scene and scene not in shown:
            axes.text(
                0,
                y,
                "not measured ",
                ha="right",
                va="center",
                fontsize=7,
                color="0.4",
            )


def _draw(axes: Axes, dot: Dot, row: int) -> None:
    value, low, high = 100 * np.array(dot.difference)
    apart = 0.16 * (1 if dot.form == CONFIRMATORY[-1] else -1)
    spread = None
    if not (math.isnan(low) or math.isnan(high)):
        # The mean of few draws may lie a little outside their quantiles.
        spread = [[max(0, value - low)], [max(0, high - value)]]
    axes.errorbar(
        value,
        row + apart,
        xerr=spread,
        ls="",
        ms=5,
        mew=1,
        elinewidth=1.2,
        zorder=3,
        **LOOKS[dot.form],
    )


FIGURES = [
    Plot(
        "forest",
        forest,
        of="recordings",
        caption=f"Accuracy of HDC minus that of {display_name(RIVAL).lower()} on test "
        "frames, in points, one row per recording. Circles: as published; "
        "diamonds: extended (levels and LDA). The baseline gets raw or "
        f"standardised grey values, whichever suits it better. Band: ±{MARGIN:g} "
        "points. Bars: 95 %, Student over input fields or seeds, the central 95 % "
        "of resamples for cameras.",
        size=(WIDTH, 3.8),
        needs=lambda frame: bool(dots(frame)),
        commands=[f"{RUN}recordings"],
    )
]
