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
from experiments.paper_data import Update, finished, updates
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
    ("balance", 1.0): ("counters, equal votes (r = 1)", "#0072B2", "v", "--"),
    ("weight", 1.0): ("counters, counting on", "#009E73", "P", ":"),
    ("both", None): ("both prototypes kept", "#000000", "x", ":"),
}


def drift(results: Path) -> Figure | None:
    """Accuracy against N_new in both environments, and one against the other at N_new = 50."""
    measured = finished(results, "drift")
    if measured is None:
        return None
    found = updates(measured)
    stored = found["stored", None][0]
    first = next(row for row in measured.rows if row["method"] == "stored")
    known = published()
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(WIDTH, 6.6), layout="constrained")
        axes = figure.subplots(3, 1, height_ratios=(1.25, 1, 1.25))
        for place, session, name in ((axes[0], "new", "new"), (axes[1], "old", "old")):
            _curves(place, found, session)
            before = 100 * getattr(stored, session).value
            place.axhline(before, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
            place.set_ylabel(f"accuracy, {name} (%)")
        axes[0].text(200, 100 * stored.new.value - 2, "stored prototypes, p = 0", ha="right",
                     va="top", color="0.3", fontsize=6)  # fmt: skip
        axes[0].plot(N_NEW, 100 * known["drift/recovered_accuracy"], zorder=5, **PAPER)
        axes[0].plot(4.2, 100 * known["drift/stored_accuracy"], zorder=5, **PAPER)
        axes[1].sharex(axes[0])
        axes[1].set_xlabel("samples of the new environment, $N^{new}$ (5 classes)")
        _trade_off(axes[2], found, stored)
        panel(axes[0], "a", "recovered: accuracy in the new environment")
        panel(axes[1], "b", "remembered: accuracy in the old environment")
        panel(axes[2], "c", f"both, at $N^{{new}}$ = {N_NEW}")
        handles = [*axes[0].get_legend_handles_labels()[0], star("paper: p = 0; p = 0.5 or 0.75")]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        draws = len({row["draw"] for row in measured.rows if "draw" in row})
        seeds = len({row["seed"] for row in measured.rows})
        head(figure, "Recalibration after drift (Fig. 8(b))", [
            f"simulated frames, {seeds_of(seeds)}, {draws} choices of the new samples each; "
            f"old prototypes of {first['n_old']} samples; {first['n_test_new']} new and "
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
    sizes = sorted({n for key in shown for n in found[key]})
    axes.xaxis.set_major_locator(FixedLocator([n for n in sizes if n != 40 and n != 75]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda n, _: f"{n:g}")
    axes.set(xlim=(3.9, 230), ylim=(20, 103))


def _trade_off(axes: Axes, found: Updates, stored: Update) -> None:
    """New against old accuracy: a path for each family, a point for each parameter."""
    families = (
        ("replace", "#D55E00", "o", "-", "p"),
        ("balance", "#0072B2", "v", "--", "r"),
    )
    for method, colour, marker, line, name in families:
        keys = sorted(key for key in found if key[0] == method and N_NEW in found[key])
        points = [found[key][N_NEW] for key in keys]
        if method == "replace":
            points.insert(0, stored)
            keys.insert(0, ("replace", 0.0))
        _points(axes, points, colour, marker, line)
        for (_, parameter), point in zip(keys, points, strict=True):
            text = f"{name} = {parameter:g}"
            side = ("left", "right")[parameter == keys[-1][1] and method == "balance"]
            _label(axes, point, text, colour, side, method == "balance")
    for key in (("weight", 1.0), ("both", None)):
        if N_NEW in found.get(key, {}):
            _, colour, marker, line = _CURVES[key]
            _points(axes, [found[key][N_NEW]], colour, marker, line)
    axes.set(xlabel="accuracy, old (%)", ylabel="accuracy, new (%)", xlim=(22, 108), ylim=(22, 103))


def _points(axes: Axes, points: list[Update], colour: str, marker: str, line: str) -> None:
    x, dx = errors([point.old for point in points], 100)
    y, dy = errors([point.new for point in points], 100)
    axes.errorbar(x, y, xerr=dx, yerr=dy, color=colour, marker=marker, ls=line, lw=0.9,
                  elinewidth=0.5)  # fmt: skip


def _label(axes: Axes, point: Update, text: str, colour: str, side: str, above: bool) -> None:
    axes.annotate(
        text, (100 * point.old.value, 100 * point.new.value), color=colour, fontsize=5.5,
        xytext=(-3 if side == "left" else 4, 3 if above else -3), textcoords="offset points",
        ha="right" if side == "left" else "left", va="bottom" if above else "top",
    )  # fmt: skip
