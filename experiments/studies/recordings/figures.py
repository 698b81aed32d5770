"""Named forms against softmax by recording, and error against training time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.facets import intervals
from experiments.reporting.forms import FORMS, RIVAL_FORM
from experiments.reporting.plot import (
    LETTERS,
    entry,
    handle,
    legend_below,
    literal,
    look_of,
    panel,
    plain_decades,
)
from experiments.reporting.resamples import place_of
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import Table
from experiments.reporting.text import CAPTURED, COMPUTED, SIMULATED, kind_of
from experiments.studies.recordings.tables import (
    COSTS_OF,
    FEW,
    Accuracies,
    at_most_frames,
    recordings,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

SPLIT = "test and training frames of different times, sessions, groups or positions"
WIDTH = 5.4  # in; narrow, so that its letters can be read on a phone
MARGIN = 3  # points, within which two models count as equally good
HEADINGS = (CAPTURED, COMPUTED, SIMULATED)
HELD = tuple(form for form in FORMS if form != RIVAL_FORM)  # against it
# Okabe and Ito's; told apart by marker as well as by colour.
COLOURS = ("#D55E00", "#E69F00", "#0072B2", "#56B4E9", "#009E73", "#999999")
MARKERS = "oXDpsv"
SIZES = {"few": f"{FEW} frames per class", "most": "the most frames per class"}


def forest(frame: pd.DataFrame) -> pd.DataFrame:
    """Each named form minus softmax of standardised frames on each recording at five and the most
    frames per class: ``size``, ``n``, ``form`` and ``difference`` with its 95 % interval."""
    lines = []
    for scene, rows in recordings(frame).items():
        every = Accuracies(rows)
        about = {"recording": scene, "kind": kind_of(str(rows.origin.iloc[0]))}
        for size, n in zip(SIZES, (FEW, every.sizes[-1]), strict=True):
            for form in HELD:
                gap = every.difference(form, RIVAL_FORM, n)
                if not math.isnan(gap.value):
                    at = {"size": size, "n": n, "form": form}
                    lines.append(about | at | gap.columns("difference"))
    return pd.DataFrame(lines)


def draw_forest(figure: Canvas, data: pd.DataFrame) -> None:
    """Two panels: five frames per class, and the most."""
    from matplotlib.patches import Patch

    rows = _rows(data)
    figure.set_size_inches(WIDTH, 1.3 + 0.42 * len(rows))
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, letter, (size, title) in zip(panels, "ab", SIZES.items(), strict=True):
        _frame(axes, rows)
        shown = data[data["size"] == size]
        intervals(
            axes,
            shown,
            "difference",
            "recording",
            "form",
            names=rows,
            hues=HELD,
            look=lambda form: {"ms": 3.5, "elinewidth": 0.9, **_look(form)},
            scale=100,
            apart=0.66,
        )
        for missing in set(data.recording) - set(shown.recording):
            place: Any = {"ha": "right", "va": "center", "fontsize": 7, "color": "0.4"}
            axes.text(0, rows.index(missing), "not measured ", **place)
        axes.set_title(f"({letter}) {title}", loc="left", fontsize=8, pad=3)
    names = [name if name in HEADINGS else literal(scene_name(name)) for name in rows]
    panels[0].set_yticks(range(len(rows)), names, fontsize=8)
    for label, name in zip(panels[0].get_yticklabels(), rows, strict=True):
        label.set_fontweight("bold" if name in HEADINGS else "normal")
    handles: list[Any] = [
        entry(display_name(form), ls="", ms=4, **_look(form)) for form in HELD
    ]
    handles.append(Patch(color="0.88", label=f"±{MARGIN:g} points"))
    legend_below(figure, handles, 3)


def _look(form: str) -> dict[str, Any]:
    place = HELD.index(form)
    return {"color": COLOURS[place], "marker": MARKERS[place]}


def _rows(data: pd.DataFrame) -> list[str]:
    """Kinds and recordings from top to bottom."""
    rows = []
    for kind in HEADINGS:
        scenes = data.recording[data.kind == kind].unique()
        if len(scenes):
            rows += [kind, *sorted(scenes, key=place_of)]
    return rows


def _frame(axes: Axes, rows: list[str]) -> None:
    axes.axvspan(-MARGIN, MARGIN, color="0.88", lw=0, zorder=0)
    axes.axvline(0, color="0.4", lw=0.7, zorder=1)
    for y, name in enumerate(rows):
        if name not in HEADINGS:
            axes.axhline(y, color="0.93", lw=0.5, zorder=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("minus softmax (points)", fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


# Error against training time ----------------------------------------------------------------------

ACROSS = 3  # panels in a row


def errors(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Error and training time of each model at the most frames per class, on the first recording of
    each source."""
    most = at_most_frames(frame)
    if not len(most):
        return None
    first: dict[str, str] = {}
    for scene in sorted(most.recording.unique(), key=place_of):
        first.setdefault(configs.scene_display(scene)["family"], scene)
    shown = most[most.recording.isin(first.values())]
    return shown[["recording", "n", "model", "error", "fit_best_s"]]


def draw_errors(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per recording; the Pareto front is joined."""
    scenes = sorted(data.recording.unique(), key=place_of)
    down = -(-len(scenes) // ACROSS)
    figure.set_size_inches(7.0, 0.9 + 1.7 * down)
    panels = figure.subplots(down, ACROSS, squeeze=False).ravel()
    for unused in panels[len(scenes) :]:
        unused.set_visible(False)
    for letter, axes, scene in zip(LETTERS, panels, scenes, strict=False):
        rows = data[data.recording == scene]
        _draw_models(axes, rows)
        panel(axes, letter, f"{literal(scene_name(scene))}, n = {rows.n.iloc[0]}")
        axes.set(xlabel="training (s)", ylabel="test error (%)")
        axes.set_ylim(bottom=-4 * rows.error.max())  # shows a whole marker at zero
    named = [handle(model) for model in FORMS if model in set(data.model)]
    legend_below(figure, [*named, entry("other models", **_OTHER)], 4)


_OTHER: Any = {"ls": "", "marker": ".", "color": "0.7"}


def _draw_models(axes: Axes, rows: pd.DataFrame) -> None:
    """A marker per model; a line joins the Pareto front."""
    front = rows[is_on_front(rows.fit_best_s, rows.error)].sort_values("fit_best_s")
    step: Any = {"where": "post", "color": "0.6", "lw": 1.0, "zorder": 0, "marker": ""}
    axes.step(front.fit_best_s, 100 * front.error, **step)
    for row in rows.itertuples():
        model = str(row.model)
        look = {**look_of(model), "ls": ""} if model in FORMS else _OTHER
        axes.plot(row.fit_best_s, 100 * row.error, **look)
    axes.set_xscale("log")
    plain_decades(axes)
    axes.grid(color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def is_on_front(times: pd.Series, errors: pd.Series) -> list[bool]:
    """Whether no other point has less time and less error, or as much of one and less of the
    other."""
    points = np.array([times, errors], float).T
    found = []
    for point in points:
        no_worse = (points <= point).all(axis=1)
        better = (points < point).any(axis=1)
        found.append(not (no_worse & better).any())
    return found


FIGURES = [
    Figure(
        "forest",
        Table("forest", forest, of="recordings", commands=[f"{RUN}recordings"]),
        draw_forest,
        title="Accuracy minus that of softmax, by recording",
        details=SPLIT,
        caption="Accuracy on test frames minus that of softmax regression on standardised frames, "
        "fitted to convergence, in points, one row per recording: HDC as published, three forms "
        "with LDA, and two simple baselines. Right of the line: more accurate than softmax. Band: "
        f"±{MARGIN:g} points, the loss that rules 4 count as none. Bars: 95 %, Student over input "
        "fields or seeds, the central 95 % of draws for cameras; none with fewer than ten draws.",
        size=(WIDTH, 3.8),
    ),
    Figure(
        "recordings_error_vs_time",
        Table("recordings_error_vs_time", errors, of=COSTS_OF),
        draw_errors,
        title="Test error against training time, a recording of each source",
        details=SPLIT,
        caption="Test error against training time at the most frames per class, one panel per "
        "source (its first recording; the table has all), with compiled kernels if they are "
        "faster. Grey line: the Pareto front, where no other model has less of both.",
        size=(7.0, 4.3),
    ),
]
