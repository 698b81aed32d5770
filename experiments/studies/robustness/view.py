"""What is left of the accuracy under disturbances, as a table and a figure.

Of disturbed frames, bounds are Student's over seeds (of one seed: Wilson's). A single
flipped bit can ruin all predictions of a draw at once, so of flipped bits they are the lowest and
the highest accuracy of a draw.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.estimates import Estimate, mean_share
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    bars,
    errors,
    handle,
    head,
    seeds_of,
)
from experiments.reporting.rows import display_name, frames_of
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table, frame, interval, percent, size

FLIPS = ("bit_flips", "bit_flips_int8")
# What a disturbance is called, the unit of its level, and the number of units in a level of 1.
LEVELS = {
    "none": ("none", "", 1),
    "power": ("laser power ±", "%", 100),
    "dead_pixels": ("dead pixels", "%", 100),
    "shift": ("camera shifted", "px", 1),
    "bit_flips": ("bit error rate", "", 1),
    "bit_flips_int8": ("bit error rate, 8-bit numbers", "", 1),
}
Accuracies = Mapping[tuple[str, float], Mapping[str, Estimate]]


def tables(results: Results) -> Iterator[Table]:
    """Accuracy of each model under each disturbance, a table for each set of frames."""
    for place, measured in with_places(results, "robustness"):
        found = accuracies(measured)
        sizes = {row["model"]: int(row["model_bits"]) // 8 for row in measured.rows}
        yield Table(
            f"robustness{place}",
            f"Test accuracy, %, when something goes wrong after training, on {_frames(measured)}",
            frame(_row(case, by_model) for case, by_model in found.items()),
            {
                "Disturbance": lambda row: LEVELS[row["disturbance"]][0],
                "Level": lambda row: _level(row["disturbance"], row["level"]),
                **{
                    f"{display_name(model)}, {size(sizes[model])}": partial(_cell, model)
                    for model in sizes
                },
            },
            _note(measured),
            [measured.record.command],
        )


def plots(results: Results) -> Iterator[Plot]:
    """The same as a figure."""
    for place, measured in with_places(results, "robustness"):
        yield Plot(
            f"robustness{place}",
            "Test accuracy against the bit error rate of the stored model, and with disturbed "
            "frames.",
            partial(figure, measured),
            [measured.record.command],
        )


def accuracies(measured: Measured) -> Accuracies:
    """Accuracy by (disturbance, level) and model, mean over its seeds and draws."""
    rows: dict[tuple[str, float], dict[str, list[dict[str, str]]]] = {}
    for row in measured.rows:
        by_model = rows.setdefault((row["disturbance"], float(row["level"])), {})
        by_model.setdefault(row["model"], []).append(row)
    return {
        case: {model: _pooled(case[0], same) for model, same in by_model.items()}
        for case, by_model in rows.items()
    }


def _pooled(disturbance: str, rows: Sequence[Mapping[str, str]]) -> Estimate:
    shares = [int(row["right"]) / int(row["n_test"]) for row in rows]
    if disturbance not in FLIPS:
        return mean_share(shares, int(rows[0]["n_test"]))  # a row a seed
    return Estimate(float(np.mean(shares)), min(shares), max(shares))


def _frames(measured: Measured) -> str:
    """``simulated frames of 5 classes``."""
    classes = round(1 / float(measured.rows[0]["chance"]))
    return f"{frames_of(measured.rows)}, {classes} classes"


# Table --------------------------------------------------------------------------------------------


def _row(case: tuple[str, float], by_model: Mapping[str, Estimate]) -> dict[str, Any]:
    row: dict[str, Any] = dict(zip(("disturbance", "level"), case, strict=True))
    for model, found in by_model.items():
        row |= found.columns(model)
    return row


def _cell(model: str, row: Mapping[str, Any]) -> str:
    value, low, high = (percent(row.get(f"{model}{end}")) for end in ("", "_low", "_high"))
    if row["disturbance"] not in FLIPS:
        return interval(value, low, high)
    return value if low == high else f"{value} ({low}…{high})"


def _level(disturbance: str, level: float) -> str:
    """A level with its unit; nothing where there is no disturbance."""
    _, unit, units = LEVELS[disturbance]
    if disturbance in FLIPS and 0 < level < 0.01:
        return f"{level:.0e}"
    return "" if disturbance == "none" else f"{level * units:g} {unit}".strip()


def _note(measured: Measured) -> str:
    stops: Mapping[str, Any] = measured.record.config.get("stops", {})
    early = [
        display_name(name)
        for name, rule in stops.items()
        if rule.get("reached_after_s") is not None
    ]
    text = (
        f"{_seeds(measured)}. Laser power: another factor for every frame. Dead pixels read zero, "
        "the same in all frames. In square brackets: Student, 95 %, over seeds (of one: "
        "Wilson). Bit error rate: of the bytes of every stored tensor but the labels of nearest "
        "neighbour; in round brackets the lowest and the highest draw. 8-bit numbers: the same "
        "with every float32 rounded to one of 255 equal steps before. Heads: bytes of the stored "
        "model."
    )
    if early:
        text += (
            f" Trained only until the training accuracy exceeded 90 % (stop=reached), and so short "
            f"of its best: {', '.join(early)}."
        )
    return text


def _seeds(measured: Measured) -> str:
    draws = {row["draw"] for row in measured.rows}
    text = seeds_of(len({row["seed"] for row in measured.rows}))
    return text if len(draws) == 1 else f"{text}, {len(draws)} draws of bits each"


# Figure -------------------------------------------------------------------------------------------


def figure(measured: Measured) -> Figure:
    """Accuracy against bit error rate and against the disturbances of frames."""
    found = accuracies(measured)
    models = list(dict.fromkeys(row["model"] for row in measured.rows))
    chance = 100 * float(measured.rows[0]["chance"])
    of_frames = [
        name
        for name in LEVELS
        if name not in ("none", *FLIPS) and any(name == disturbance for disturbance, _ in found)
    ]
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(WIDTH, 6.4), layout="constrained")
        grid = figure.add_gridspec(3, max(1, len(of_frames)), height_ratios=(1.2, 1.2, 1))
        top, middle = (figure.add_subplot(grid[k, :]) for k in (0, 1))
        for axes, name, text in (
            (top, "bit_flips", "as stored: float32, bits, counters"),
            (middle, "bit_flips_int8", "the same, but 8 bits for each float32"),
        ):
            _bit_flips(axes, found, models, name)
            axes.text(0.01, 3, text, transform=axes.get_yaxis_transform(), fontsize=6)
        top.tick_params(labelbottom=False)
        middle.set_xlabel("bit error rate of the stored model\n(bars: lowest to highest draw)")
        for k, name in enumerate(of_frames):
            axes = figure.add_subplot(grid[2, k])
            _disturbed(axes, found, models, name)
            if k:
                axes.set_yticklabels([])
            else:
                axes.set_ylabel("test accuracy (%)")
        for axes in figure.axes:
            axes.axhline(chance, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.set_ylim(0, 104)
        top.text(
            0.01,
            chance - 1,
            "chance",
            transform=top.get_yaxis_transform(),
            va="top",
            color="0.3",
            fontsize=6,
        )
        figure.legend(handles=list(map(handle, models)), loc="outside lower center", ncols=2)
        head(
            figure,
            "Test accuracy when something goes wrong after training",
            [
                f"{_frames(measured)}, {_seeds(measured)}; disturbed frames: 95 % intervals",
            ],
        )
    return figure


def _bit_flips(axes: Axes, found: Accuracies, models: Sequence[str], name: str) -> None:
    """Means over a logarithmic rate, from lowest to highest draw; no flips at its left end.

    A model without rows of this name, since it stores no floating-point numbers, is drawn with
    those of its bits as they are.
    """
    rates = sorted({level for disturbance, level in found if disturbance in FLIPS} - {0.0})
    axes.set_xscale("log")
    axes.set_ylabel("test accuracy (%)")
    if not rates:
        return
    none = rates[0] / 10
    for k, model in enumerate(models):
        own = {case: by_model[model] for case, by_model in found.items() if model in by_model}
        shown = name if any(disturbance == name for disturbance, _ in own) else "bit_flips"
        points = {0.0: own["none", 0.0]}
        points |= {level: one for (disturbance, level), one in own.items() if disturbance == shown}
        x = np.array([level or none for level in points]) * 1.03 ** (k - len(models) // 2)
        y, spread = errors(list(points.values()), 100)
        bars(axes, model, x, y, spread, elinewidth=0.4)
    decades = [10.0**k for k in range(-12, 1, 2) if none < 10.0**k <= 1]
    axes.set_xticks([none, *decades], ["0", *(f"$10^{{{np.log10(d):.0f}}}$" for d in decades)])
    axes.set_xticks([], minor=True)
    axes.set_xlim(none / 2, 1)


def _disturbed(axes: Axes, found: Accuracies, models: Sequence[str], name: str) -> None:
    """Accuracies side by side at each level of one disturbance, none of it at the left."""
    label, unit, units = LEVELS[name]
    cases = [("none", 0.0), *sorted(case for case in found if case[0] == name)]
    for k, model in enumerate(models):
        places = [i for i, case in enumerate(cases) if model in found.get(case, {})]
        y, spread = errors([found[cases[i]][model] for i in places], 100)
        x = np.array(places) + 0.08 * (k - (len(models) - 1) / 2)
        bars(axes, model, x, y, spread, ls="", elinewidth=0.6, markersize=2.5)
    axes.set_xticks(range(len(cases)), [f"{level * units:g}" for _, level in cases])
    axes.set_xlabel(f"{label} ({unit})")


STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy is left when the frames are disturbed after training, or bits of the stored "
    "model flip? Does hyperdimensional computing tolerate the faults it is said to tolerate?",
    9.5,
    tables,
    plots,
)
