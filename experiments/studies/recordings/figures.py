"""Error against training time on public data sets, and how often a model is fast for its error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records import configs
from experiments.reporting.columns import scene_name
from experiments.reporting.forms import FORMS
from experiments.reporting.pareto import is_on_front
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
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.studies.recordings.tables import COSTS_OF, at_most_frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

SPLIT = (
    "test frames are of another time, session, group or position than training frames"
)
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
        panel(axes, letter, literal(scene_name(scene)))
        axes.set(xlabel="training (s)", ylabel="test error (%)")
        axes.set_ylim(bottom=-4 * rows.error.max())  # shows a whole marker at zero
    found = set(data.model)
    named = [handle(model, **_look(model)) for model in FORMS if model in found]
    legend_below(figure, [*named, entry("other models", **_OTHER)], 3)


_OTHER: Any = {"ls": "", "marker": ".", "color": "0.7"}


def _look(model: str) -> dict[str, Any]:
    return {**look_of(model), "ls": ""}


def _details(data: pd.DataFrame) -> str:
    """Frames per class, fewest to most, and the split."""
    sizes = "–".join(map(str, sorted({data.n.min(), data.n.max()})))
    return f"{sizes} training frames per class; {SPLIT}"


def _draw_models(axes: Axes, rows: pd.DataFrame) -> None:
    """A marker per model; a line joins the Pareto front."""
    front = rows[is_on_front(rows.fit_best_s, rows.error)].sort_values("fit_best_s")
    step: Any = {"where": "post", "color": "0.6", "lw": 1.0, "zorder": 0, "marker": ""}
    axes.step(front.fit_best_s, 100 * front.error, **step)
    for row in rows.itertuples():
        model = str(row.model)
        look = _look(model) if model in FORMS else _OTHER
        axes.plot(row.fit_best_s, 100 * row.error, **look)
    axes.set_xscale("log")
    plain_decades(axes)
    axes.grid(color="0.92", lw=0.5)
    axes.set_axisbelow(True)


# The performance profile --------------------------------------------------------------------------


def profile(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each model and recording at the most frames per class.

    ``factor`` is its training time relative to the fastest model that errs no more, which may be
    itself; ``share`` is the share of recordings on which its factor is at most this one (Dolan and
    Moré, Math. Program. 91, 201 (2002)). Models that were not measured on all recordings are left
    out.
    """
    most = at_most_frames(frame)
    if not len(most):
        return None
    ordered = most.sort_values("error")
    fastest = ordered.groupby("recording").fit_best_s.cummin()
    fastest = fastest.groupby([ordered.recording, ordered.error]).transform("min")
    lines = ordered.assign(factor=ordered.fit_best_s / fastest)
    every = lines.recording.nunique()
    whole = lines.groupby("model").recording.transform("nunique") == every
    lines = lines[whole].sort_values(["model", "factor"], kind="stable")
    rank = lines.groupby("model").factor.rank("max")
    return lines.assign(share=rank / every)[["model", "factor", "share"]]


def draw_profile(figure: Canvas, data: pd.DataFrame) -> None:
    """A step line per model, from the left edge to the right one."""
    axes = figure.subplots()
    other: Any = {"marker": "", "color": "0.8", "lw": 0.8, "zorder": 1}
    end = 1.5 * data.factor.max()
    for model, rows in data.groupby("model"):
        look = {**look_of(str(model)), "ms": 4} if model in FORMS else other
        factors = [1.0, *rows.factor, end]
        shares = [0.0, *rows.share, rows.share.max()]
        measured = slice(1, len(factors) - 1)
        axes.step(factors, shares, where="post", markevery=measured, **look)
    axes.set(xscale="log", xlim=(0.95, end), ylim=(0, 1.03))
    axes.set_xlabel("training time relative to\nthe fastest model of no more error")
    axes.set_ylabel("share of data sets")
    plain_decades(axes)
    names = [handle(model) for model in FORMS if model in set(data.model)]
    legend_below(figure, [*names, entry("other models", **other)], 2)


FIGURES = [
    Figure(
        "recordings_error_vs_time",
        Table("recordings_error_vs_time", errors, of=COSTS_OF),
        draw_errors,
        title="Test error against training time, one data set of each source",
        details=_details,
        caption="Test error against training time at the most frames per class, one panel per "
        "source (its first data set; the table has all), with compiled kernels if "
        "faster. Grey line: the Pareto front, where no other model has less of both.",
        size=(7.0, 4.3),
    ),
    Figure(
        "performance_profile",
        Table("performance_profile", profile, of=COSTS_OF),
        draw_profile,
        title="How often a model is fast for its accuracy",
        details=SPLIT,
        caption="Share of the data sets on which a model trains within a factor of the fastest "
        "model that errs no more than it does, at the most frames per class, with compiled kernels "
        "if they are faster. At a factor of 1, a model is the fastest of its accuracy.",
        size=(3.4, 3.4),
    ),
]
