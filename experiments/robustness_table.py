"""What is left of the accuracy under disturbances: the rows of experiments.robustness, pooled.

Intervals are Wilson's for the test samples of all seeds (and draws) together. A single flipped bit
can ruin all predictions of a draw at once, so for flipped bits the lowest and the highest accuracy
of a draw say more: they are what the Markdown table and the figure show.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments import evaluate, measurement
from experiments.robustness import NAME
from experiments.table_text import bytes_cell, display_name, interval_cell, origin, percent
from experiments.tables import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = (
    "model", "disturbance", "level", "test_accuracy_final", "test_ci_low", "test_ci_high",
    "lowest", "highest", "n_test", "seeds", "draws", "model_bytes", "chance", "scene", "origin",
    "code",
)  # fmt: skip
# What a disturbance is called, the unit of its level, and the number of units in a level of 1.
_LEVELS = {
    "none": ("none", "", 1),
    "power": ("laser power ±", "%", 100),
    "dead_pixels": ("dead pixels", "%", 100),
    "shift": ("camera shifted", "px", 1),
    "bit_flips": ("bit error rate", "", 1),
    "bit_flips_int8": ("bit error rate, 8-bit numbers", "", 1),
}


_FLIPS = ("bit_flips", "bit_flips_int8")


def rows(results: Path) -> list[Row]:
    """One row for each model, disturbance and level; none without a finished measurement.

    Args:
        results: the folder that holds ``measured/``.
    """
    measured = measurement.read(results, NAME)
    if measured is None or measured.record["status"] != "finished":
        return []
    groups: dict[tuple[str, str, float], list[dict[str, str]]] = {}
    for line in measured.rows:
        key = (line["model"], line["disturbance"], float(line["level"]))
        groups.setdefault(key, []).append(line)
    code = ", ".join(measured.outdated) or "current"
    return [{**_pooled(key, lines), "code": code} for key, lines in groups.items()]


def markdown(rows: Sequence[Row]) -> str:
    """A table with a line for each disturbance and a column for each model."""
    models = list(dict.fromkeys(row["model"] for row in rows))
    cases = list(dict.fromkeys((row["disturbance"], row["level"]) for row in rows))
    known = {(row["model"], row["disturbance"], row["level"]): row for row in rows}
    sizes = {row["model"]: bytes_cell(row["model_bytes"]) for row in rows}
    lines = [["Disturbance", "Level", *map(display_name, models)]]
    lines += [["---"] * len(lines[0]), ["stored model", "", *(sizes[m] for m in models)]]
    for name, level in cases:
        lines.append(
            [
                _LEVELS[name][0],
                _level(name, level),
                *(_cell(known.get((m, name, level))) for m in models),
            ]
        )
    scene = " and ".join(sorted({row["scene"] for row in rows}))
    seeds, draws = (_span(rows, key) for key in ("seeds", "draws"))
    old = next((row["code"] for row in rows if row["code"] != "current"), None)
    notes = (
        f"Test accuracy in % after training on undisturbed frames; seeds: {seeds}. Laser power: "
        "another factor for every frame. Dead pixels read zero, the same in all frames. Disturbed "
        "frames: Wilson interval, 95 %. Bit error rate: of the bytes of every stored tensor; mean "
        f"(lowest … highest) of {draws} draws. 8-bit numbers: the same with every float32 rounded "
        "to one of 255 equal steps before."
    ) + (f" Made by other code than this ({old} changed since)." if old else "")
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    title = f"**Robustness, on {origin(rows)} frames of the scene “{scene}”**"
    return f"{title}\n\n{table}\n\n{notes}\n"


def figure(rows: Sequence[Row]) -> Figure | None:
    """Accuracy against bit error rate and against the disturbances of frames; None without rows."""
    if not rows:
        return None
    from experiments.figures import STYLE, WIDTH, _handle, _title, plt

    models = list(dict.fromkeys(row["model"] for row in rows))
    frames = [name for name in ("power", "dead_pixels", "shift")
              if any(row["disturbance"] == name for row in rows)]  # fmt: skip
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(WIDTH, 6.4))
        grid = figure.add_gridspec(3, max(1, len(frames)), height_ratios=(1.2, 1.2, 1))
        top = figure.add_subplot(grid[0, :])
        _bit_flips(top, rows, models, "bit_flips")
        top.tick_params(labelbottom=False)
        middle = figure.add_subplot(grid[1, :])
        _bit_flips(middle, rows, models, "bit_flips_int8")
        middle.set_xlabel("bit error rate of the stored model\n(bars: lowest to highest draw)")
        for axes, text in ((top, "as stored: float32, bits, counters"),
                           (middle, "the same, but 8 bits for each float32")):  # fmt: skip
            axes.text(0.01, 3, text, transform=axes.get_yaxis_transform(), fontsize=6)
        for k, name in enumerate(frames):
            _of_frames(figure.add_subplot(grid[2, k]), rows, models, name, first=k == 0)
        for axes in figure.axes:
            axes.axhline(100 * rows[0]["chance"], color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.set_ylim(0, 104)
        top.text(0.01, 100 * rows[0]["chance"] - 1, "chance", transform=top.get_yaxis_transform(),
                 va="top", color="0.3", fontsize=6)  # fmt: skip
        _title(figure, top, "Test accuracy when something goes wrong after training", rows,
               models, models, [_handle(model) for model in models])  # fmt: skip
    return figure


def _pooled(key: tuple[str, str, float], lines: Sequence[dict[str, str]]) -> Row:
    """The row of one model, disturbance and level, from all its seeds and draws."""
    model, disturbance, level = key
    right, n_test = (sum(int(line[name]) for line in lines) for name in ("right", "n_test"))
    low, high = evaluate.wilson(right, n_test)
    accuracies = [float(line["accuracy"]) for line in lines]
    return {
        "model": model,
        "disturbance": disturbance,
        "level": level,
        "test_accuracy_final": right / n_test,
        "test_ci_low": low,
        "test_ci_high": high,
        "lowest": min(accuracies),
        "highest": max(accuracies),
        "n_test": n_test,
        "seeds": len({line["seed"] for line in lines}),
        "draws": len(lines),
        "model_bytes": int(lines[0]["model_bits"]) // 8,
        "chance": float(lines[0]["chance"]),
        "scene": lines[0]["scene"],
        "origin": lines[0]["origin"],
    }


def _span(rows: Sequence[Row], key: str) -> str:
    """The largest of the counts in a column; all of them, where models differ."""
    found = {row["model"]: 0 for row in rows}
    for row in rows:
        found[row["model"]] = max(found[row["model"]], row[key])
    return " to ".join(map(str, sorted(set(found.values()))))


def _level(name: str, level: float) -> str:
    """A level with its unit; nothing where there is no disturbance."""
    _, unit, units = _LEVELS[name]
    if name in _FLIPS and 0 < level < 0.01:
        return f"{level:.0e}"
    return "" if name == "none" else f"{level * units:g} {unit}".strip()


def _cell(row: Row | None) -> str:
    if row is None:
        return "–"
    if row["disturbance"] not in _FLIPS:
        return interval_cell(row)
    mean, low, high = (percent(row[key]) for key in ("test_accuracy_final", "lowest", "highest"))
    return mean if low == high else f"{mean} ({low}…{high})"


def _bit_flips(axes: Axes, rows: Sequence[Row], models: Sequence[str], name: str) -> None:
    """Means over a logarithmic rate, from lowest to highest draw; no flips at its left end.

    A model without rows of this name, since it stores no floating-point numbers, is drawn with
    those of its bits as they are.
    """
    from experiments.figures import fill_of, style_of

    rates = sorted({row["level"] for row in rows if row["disturbance"] in _FLIPS} - {0.0})
    axes.set_xscale("log")
    axes.set_ylabel("test accuracy (%)")
    if not rates:
        return
    none = rates[0] / 10
    for k, model in enumerate(models):
        own = [row for row in rows if row["model"] == model]
        lines = [row for row in own if row["disturbance"] == name]
        lines = lines or [row for row in own if row["disturbance"] == "bit_flips"]
        if 0.0 not in {row["level"] for row in lines}:
            lines = [*(row for row in own if row["disturbance"] == "none"), *lines]
        x = np.array([row["level"] or none for row in lines]) * 1.03 ** (k - len(models) // 2)
        y, low, high = (
            100 * np.array([row[key] for row in lines])
            for key in ("test_accuracy_final", "lowest", "highest")
        )
        colour, marker, style = style_of(model)
        axes.errorbar(x, y, yerr=[y - low, high - y], color=colour, marker=marker,
                      mfc=fill_of(model), ls=style, elinewidth=0.4, lw=0.9)  # fmt: skip
    decades = [10.0**k for k in range(-12, 1, 2) if none < 10.0**k <= 1]
    axes.set_xticks([none, *decades], ["0", *(f"$10^{{{np.log10(d):.0f}}}$" for d in decades)])
    axes.set_xticks([], minor=True)
    axes.set_xlim(none / 2, 1)


def _of_frames(
    axes: Axes, rows: Sequence[Row], models: Sequence[str], name: str, first: bool
) -> None:
    """Accuracies side by side at each level of one disturbance, none of it at the left."""
    from experiments.figures import fill_of, style_of

    title, unit, units = _LEVELS[name]
    levels = [0.0, *sorted({row["level"] for row in rows if row["disturbance"] == name})]
    for k, model in enumerate(models):
        lines = [row for row in rows if row["model"] == model
                 and row["disturbance"] in ("none", name)]  # fmt: skip
        x = [levels.index(row["level"]) + 0.08 * (k - (len(models) - 1) / 2) for row in lines]
        y, low, high = (
            100 * np.array([row[key] for row in lines])
            for key in ("test_accuracy_final", "test_ci_low", "test_ci_high")
        )
        colour, marker, _ = style_of(model)
        axes.errorbar(x, y, yerr=[y - low, high - y], color=colour, marker=marker,
                      mfc=fill_of(model), ls="", elinewidth=0.6, markersize=2.5)  # fmt: skip
    axes.set_xticks(range(len(levels)), [f"{level * units:g}" for level in levels])
    axes.set_xlabel(f"{title} ({unit})")
    if first:
        axes.set_ylabel("test accuracy (%)")
    else:
        axes.set_yticklabels([])
