"""Figures of drift: recalibration with labels (Fig. 8(b)) and re-referencing without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.reporting.columns import display_name
from experiments.reporting.curves import errors
from experiments.reporting.estimates import Estimate
from experiments.reporting.plot import (
    LETTERS,
    PAPER,
    head,
    literal,
    look_of,
    panel,
    wrapped,
)
from experiments.reporting.study import WIDTH
from experiments.studies.drift.numbers import N_NEW

N_UNLABELLED = 30
_DASHED: Any = {"color": "0.5", "lw": 0.8, "ls": (0, (4, 3)), "zorder": 0}
# Shares of bits that HDC replaces, from light to dark: colour and marker.
_SHARES = {
    "bits replaced, p = 0.25": ("p = 0.25", "#F3C19B", "o"),
    "bits replaced, p = 0.5": ("p = 0.5", "#E8924F", "s"),
    "bits replaced, p = 0.75": ("p = 0.75", "#D55E00", "D"),
    "new samples alone": ("p = 1: new samples alone", "#7A3600", "^"),
}
# Updates without labels beside what they are compared with: new frames, colour, marker, fill.
_UPDATES = {
    "not updated": (0, "0.3", "o", "white"),
    "re-referenced, all classes alike": (N_UNLABELLED, "#E8924F", "o", None),
    "re-referenced, 100 % of one class": (N_UNLABELLED, "#7A3600", "X", None),
    "new samples alone": (N_NEW, "#0072B2", "*", None),
}


def recalibrations(figure: Figure, found: pd.DataFrame, scene: str) -> None:
    """HDC by shares of replaced bits in both sessions; the best update of each model.

    Args:
        figure: drawn on.
        found: :func:`.numbers.regained`.
        scene: what it is of.
    """
    new, old, models = figure.subplots(1, 3, sharey=True)
    of_hdc = found[found.model == "hdc"]
    for axes, session in ((new, "updated"), (old, "old")):
        for update, (label, colour, marker) in _SHARES.items():
            of_update = of_hdc[of_hdc["update"] == update]
            look = {"color": colour, "marker": marker, "label": label}
            _line(axes, of_update, session, look)
        before = "stored" if axes is new else "before"
        axes.axhline(100 * of_hdc[before].mean(), **_DASHED)
    for model, update in best_of_each(found):
        of_update = found[(found.model == model) & (found["update"] == update)]
        label = f"{literal(display_name(model))}:\n{update}"
        _line(models, of_update, "updated", {**look_of(model), "label": label})
    panel(new, "a", "HDC, new session")
    panel(old, "b", "HDC, old session")
    panel(models, "c", "best updates, new session")
    new.set(ylabel="accuracy (%)", ylim=(0, 104))
    level = 100 * of_hdc.stored.mean()
    new.annotate(
        "not updated", (0.97, level - 6), xycoords=("axes fraction", "data"), ha="right"
    )
    old.legend(loc=(0.2, 0.48))
    models.legend(loc="lower right", handlelength=2)
    sizes = sorted(found.n_new[found.labels].unique())
    for axes in (new, old, models):
        axes.set(xscale="log", xlabel="samples of the new session, $N^{new}$")
        axes.set_xlim(0.8 * min(sizes), 1.25 * max(sizes))
        axes.set_xticks(sizes, map(str, sizes))
        axes.set_xticks([], minor=True)
    details = ["new samples first in time, 95 % intervals over seeds"]
    head(figure, f"Recalibration with labels: {scene}", details)


def best_of_each(found: pd.DataFrame) -> list[tuple[str, str]]:
    """Models that are updated with labels, and the update of each that is best after N_NEW."""
    without = found[~found.labels].model.unique()
    at = found[found.labels & ~found.model.isin(without) & (found.n_new == N_NEW)]
    best = at.groupby("model", sort=False).updated.idxmax()
    return list(at.loc[best, ["model", "update"]].itertuples(index=False, name=None))


def of_paper(axes: Axes, values: Sequence[float]) -> None:
    """The paper's accuracies in percent: stored, at the left edge, and after N_NEW samples."""
    axes.plot(0.015, values[0], zorder=5, transform=axes.get_yaxis_transform(), **PAPER)
    axes.plot(N_NEW, values[1], zorder=5, label="paper: p = 0; 0.5 or 0.75", **PAPER)
    axes.legend(handles=axes.lines[-1:], loc="lower right")


def without_labels(
    figure: Figure, panels: Mapping[str, tuple[pd.DataFrame, float]]
) -> None:
    """A row per model: accuracy in the new session after each update.

    Args:
        figure: drawn on; its height is set.
        panels: by the name of a scene, :func:`.numbers.regained`, and chance in percent.
    """
    figure.set_size_inches(WIDTH, 1.5 + 1.3 * len(panels))
    every = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
    for axes, letter, (scene, (found, chance)) in zip(
        every, LETTERS, panels.items(), strict=False
    ):
        _updates(axes, found)
        panel(axes, letter, scene)
        axes.axvline(chance, **_DASHED)
    every[-1].set(xlim=(0, 102), xlabel="accuracy in the new session (%)")
    handles, _ = every[-1].get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=1)
    details = ["new frames first in time; dashed: chance"]
    head(figure, "Re-referencing without labels, by scene", details)


def _updates(axes: Axes, found: pd.DataFrame) -> None:
    """A row per model, a marker per update, one below the other."""
    first = found[found.n_new == N_UNLABELLED].assign(n_new=0, update="not updated")
    for end in ("", "_low", "_high"):
        first[f"updated{end}"] = first[f"stored{end}"]
    found = pd.concat([first.drop_duplicates("model"), found])
    models = list(first.model.unique())
    for k, (update, (n, colour, marker, fill)) in enumerate(_UPDATES.items()):
        of_update = found[(found["update"] == update) & (found.n_new == n)]
        values, spread = errors(_estimates(of_update, "updated"), 100)
        places = of_update.model.map(models.index) + 0.15 * (k - 1.5)
        look: dict[str, Any] = {"color": colour, "marker": marker, "ls": "", "ms": 4}
        look["mfc"] = fill or colour
        axes.errorbar(values, places, xerr=spread, elinewidth=0.5, **look)
        n_frames = f", {n} frames" if n else ""
        axes.plot([], [], label=f"{update}{n_frames}", **look)
    names = [wrapped(display_name(model), 22) for model in models]
    axes.set_yticks(range(len(models)), names)
    axes.invert_yaxis()
    axes.tick_params(axis="y", length=0)


def _line(axes: Axes, found: pd.DataFrame, name: str, look: Mapping[str, Any]) -> None:
    """A column of accuracies against the new frames, with its intervals."""
    values, spread = errors(_estimates(found, name), 100)
    axes.errorbar(found.n_new, values, yerr=spread, lw=0.9, elinewidth=0.5, **look)


def _estimates(found: pd.DataFrame, name: str) -> list[Estimate]:
    ends = found[[name, f"{name}_low", f"{name}_high"]]
    return [Estimate(*line) for line in ends.to_numpy(float)]
