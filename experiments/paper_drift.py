"""Drift and recalibration (Fig. 8(b)): accuracy in the new and in the old environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from experiments.figures import STYLE, WIDTH
from experiments.paper_data import Update, finished, origin_of, updates
from experiments.paper_numbers import N_NEW
from experiments.paper_style import PAPER, changed, errors, head, panel, seeds_of, star
from experiments.tables import published

Key = tuple[str, float | None]
Updates = Mapping[Key, Mapping[int, Update]]

# The paper's scheme from light to dark as p grows; Okabe and Ito's blue and green for the others.
_CURVES: dict[Key, tuple[str, str, str, str]] = {
    ("replace", 0.25): ("p = 0.25", "#F3C19B", "o", "-"),
    ("replace", 0.5): ("p = 0.5", "#E8924F", "s", "-"),
    ("replace", 0.75): ("p = 0.75", "#D55E00", "D", "-"),
    ("replace", 1.0): ("p = 1", "#7A3600", "^", "-"),
    ("balance", 1.0): ("counters, equal votes", "#0072B2", "v", "--"),
    ("weight", 1.0): ("counters, counting on", "#009E73", "P", ":"),
    ("both", None): ("both prototypes kept", "#000000", "x", ":"),
}
_TITLES = (
    "recovered: accuracy in the new environment",
    "remembered: accuracy in the old environment",
    "mean of both",
)


def drift(results: Path) -> Figure | None:
    """Accuracy against N_new in the new and in the old environment; None without measurement."""
    measured = finished(results, "drift")
    if measured is None:
        return None
    found = updates(measured)
    stored = found["stored", None][0]
    first = next(row for row in measured.rows if row["method"] == "stored")
    known = published()
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            3, 1, figsize=(WIDTH, 6.2), sharex=True, sharey=True, layout="constrained"
        )
        for axes, letter, session, title in zip(
            panels, "abc", Update._fields, _TITLES, strict=True
        ):
            _curves(axes, found, session)
            before = 100 * getattr(stored, session).value
            axes.axhline(before, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
            axes.set_ylabel("accuracy (%)")
            panel(axes, letter, title)
        axes = panels[0]
        # Not at an N_new: placed in parts of the width.
        across = axes.get_yaxis_transform()
        axes.text(0.97, 100 * stored.new.value - 2, "stored prototypes, p = 0", ha="right",
                  va="top", color="0.3", fontsize=6, transform=across)  # fmt: skip
        axes.plot(0.015, 100 * known["drift/stored_accuracy"], zorder=5, transform=across, **PAPER)
        axes.plot(N_NEW, 100 * known["drift/recovered_accuracy"], zorder=5, **PAPER)
        panels[-1].set_xlabel("samples of the new environment, $N^{new}$")
        handles = [*panels[0].get_legend_handles_labels()[0], star("paper: p = 0; p = 0.5 or 0.75")]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        draws = len({row["draw"] for row in measured.rows if "draw" in row})
        seeds = len({row["seed"] for row in measured.rows})
        head(figure, "Recalibration after drift (Fig. 8(b))", [
            f"{origin_of(measured)} frames, {seeds_of(seeds)}, {draws} choices of the new samples "
            f"each; old prototypes of {first['n_old']} samples; {first['n_test_new']} new and "
            f"{first['n_test_old']} old test samples a seed; 95 % intervals over seeds",
            *changed(measured),
        ])  # fmt: skip
    return figure


def _curves(axes: Axes, found: Updates, session: str) -> None:
    axes.set_xscale("log")
    shown = [key for key in _CURVES if key in found]
    for k, key in enumerate(shown):
        label, colour, marker, line = _CURVES[key]
        n = np.array(list(found[key])) * 1.015 ** (k - len(shown) // 2)
        y, spread = errors([getattr(update, session) for update in found[key].values()], 100)
        axes.errorbar(n, y, yerr=spread, label=label, color=colour, marker=marker, ls=line,
                      elinewidth=0.5, lw=0.9)  # fmt: skip
    axes.xaxis.set_major_locator(FixedLocator([5, 10, 20, 30, 50, 100, 200]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda n, _: f"{n:g}")
    axes.set_ylim(20, 103)
