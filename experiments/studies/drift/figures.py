"""Figures of drift: recalibration with labels (Fig. 8(b)) and re-referencing without."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records.results import by_scene
from experiments.reporting import published
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.facets import intervals, line
from experiments.reporting.plot import (
    DASHED,
    LETTERS,
    PAPER,
    entry,
    legend_below,
    literal,
    look_of,
    panel,
    wrapped,
)
from experiments.reporting.study import WIDTH
from experiments.reporting.text import SIMULATED, kind_of
from experiments.studies.drift.numbers import N_NEW, N_ZERO

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

# Shares of bits that HDC replaces, from light to dark: colour and marker.
SHARES = (("#F3C19B", "o"), ("#E8924F", "s"), ("#D55E00", "D"), ("#7A3600", "^"))
# Updates without labels beside what they are compared with.
WAYS: dict[str, Any] = {
    "stored": {"label": "not updated", "color": "0.3", "marker": "o", "mfc": "white"},
    "alike": {
        "label": f"re-referenced by {N_ZERO} frames, equally many of each class",
        "color": "#E8924F",
        "marker": "o",
    },
    "one_class": {
        "label": f"re-referenced by {N_ZERO} frames of one class",
        "color": "#7A3600",
        "marker": "X",
    },
    "new": {
        "label": f"trained anew on {N_NEW} labelled frames",
        "color": "#0072B2",
        "marker": "*",
    },
}


def draw_recalibrated(figure: Canvas, data: pd.DataFrame) -> None:
    """HDC by shares of replaced bits in both sessions; the best update of each model."""
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    new, old, models = panels
    of_hdc = data[data.panel == "shares"]
    for (colour, marker), (p, of_share) in zip(
        SHARES, of_hdc.groupby("p"), strict=False
    ):
        look = {"color": colour, "marker": marker, "label": f"p = {p:g}"}
        line(new, of_share, "n_new", "updated", 100, **look)
        line(old, of_share, "n_new", "old", 100, **look)
    of_models = data[data.panel == "models"]
    by_model = of_models.groupby(["model", "update"], sort=False)
    for k, ((model, update), rows) in enumerate(by_model):  # set apart by a few percent
        apart = rows.assign(n_new=rows.n_new * 1.04**k)
        label = f"{literal(display_name(model))}:\n{wrapped(update, 24)}"
        line(models, apart, "n_new", "updated", 100, label=label, **look_of(model))
    new.axhline(100 * of_hdc.stored.iloc[0], **DASHED)
    old.axhline(100 * of_hdc.before.iloc[0], **DASHED)
    if kind_of(data.origin.iloc[0]) == SIMULATED:
        _draw_published(new)
    titles = ("HDC, new session", "HDC, old session", "best updates, new session")
    for axes, letter, title in zip(panels, LETTERS, titles, strict=False):
        panel(axes, letter, title)
        axes.set_xlabel("samples of the new session, $N^{new}$")
    sizes = sorted(data.n_new.unique())
    new.set(xscale="log", ylabel="accuracy (%)", ylim=(0, 104))
    new.set_xticks(sizes, map(str, sizes))
    new.set_xticks([], minor=True)
    old.legend(loc=(0.2, 0.48))
    models.legend(loc="lower right", handlelength=2)


def _draw_published(axes: Axes) -> None:
    """The paper's accuracies: stored, at the left edge, and after N_NEW samples."""
    numbers = published.numbers()
    stored = numbers["drift/stored_accuracy"].value
    recovered = numbers["drift/recovered_accuracy"].value
    at_edge: Any = {"transform": axes.get_yaxis_transform(), "clip_on": False}
    axes.plot(0.0, stored, zorder=5, **at_edge, **PAPER)
    axes.plot(N_NEW, recovered, zorder=5, **PAPER)
    axes.legend(handles=[entry("paper", **PAPER)], loc="lower right")


def draw_unlabelled(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene, a row per model, a marker per update."""
    scenes = by_scene(data)
    figure.set_size_inches(WIDTH, 1.5 + 1.3 * len(scenes))
    panels = figure.subplots(len(scenes), 1, squeeze=False, sharex=True)[:, 0]
    for axes, letter, (scene, rows) in zip(
        panels, LETTERS, scenes.items(), strict=False
    ):
        models = list(rows.model.unique())
        intervals(
            axes,
            rows,
            *("updated", "model", "way"),
            names=models,
            hues=list(WAYS),
            look=WAYS.__getitem__,
            scale=100,
            apart=0.45,
        )
        axes.axvline(100 / rows.n_classes.iloc[0], **DASHED)
        names = [wrapped(display_name(model), 22) for model in models]
        axes.set_yticks(range(len(models)), names)
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0)
        title = f"{scene_name(scene)}, {kind_of(rows.origin.iloc[0])}"
        panel(axes, letter, literal(title))
    panels[-1].set(xlim=(0, 102), xlabel="accuracy in the new session (%)")
    handles, _ = panels[-1].get_legend_handles_labels()
    legend_below(figure, handles, 1)
