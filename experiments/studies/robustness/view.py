"""Accuracy that is left under disturbances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from experiments.records import configs
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.curves import bars, errors
from experiments.reporting.estimates import Estimate, mean_share
from experiments.reporting.measured import each_scene
from experiments.reporting.plot import handle, panel, style_of, wrapped
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table

FLIPS = ("bit_flips", "bit_flips_int8", "query_flips")
# Name of a disturbance, unit of its level, and the number of units in a level of 1.
LEVELS = {
    "none": ("none", "", 1),
    "power": ("laser power ±", "%", 100),
    "dead_pixels": ("dead pixels", "%", 100),
    "shift": ("camera shifted", "px", 1),
    "query_flips": ("flipped bits of the query", "%", 100),
    "bit_flips": ("flipped bits of the model", "%", 100),
    "bit_flips_int8": ("flipped bits of the model, 8-bit numbers", "%", 100),
}


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each model by ``disturbance`` and ``level``, mean over seeds.

    Bounds are Student's interval over seeds. A flipped bit can ruin all predictions of a seed at
    once, so of flips they are the lowest and the highest seed.
    """
    table: dict[tuple[str, float], dict[str, Any]] = {}
    by = ["disturbance", "level", "model"]
    for (disturbance, level, model), same in rows.groupby(by, sort=False):
        shares = (same.right / same.n_test).astype(float)
        # The mean of equal shares may differ from them in the last digit.
        mean = float(np.clip(shares.mean(), shares.min(), shares.max()))
        estimate = Estimate(mean, shares.min(), shares.max())
        if disturbance not in FLIPS:
            estimate = mean_share(
                shares.groupby(same.seed).mean().tolist(), same.n_test.iloc[0]
            )
        line = table.setdefault(
            (disturbance, level), {"disturbance": disturbance, "level": level}
        )
        line |= estimate.columns(model)
    return pd.DataFrame(list(table.values()))


NOTE = (
    "Laser power: another factor for every frame. Dead pixels read zero, the same in all frames. "
    "In brackets: Student, 95 %, over seeds; of flips the lowest and the highest seed. Flipped "
    "bits of the query: of the hypervector of HDC, of the pixels of a frame of others. Flipped "
    "bits of the model: of every stored tensor, of lda but for its scale and offset of each class. "
    "8-bit numbers: every float32 was rounded to one of 255 equal steps before."
)


def _level(row: Mapping[str, Any]) -> str:
    """A level with its unit; nothing where there is no disturbance."""
    _, unit, units = LEVELS[row["disturbance"]]
    return (
        ""
        if row["disturbance"] == "none"
        else f"{row['level'] * units:g} {unit}".strip()
    )


def _note(rows: pd.DataFrame) -> str:
    """How to read the table, and which models were stopped at 90 % in training."""
    early: dict[str, None] = {}
    for config in rows.config.drop_duplicates().map(lambda config: config.get("stops")):
        for model, stop in (config or {}).items():
            if stop.get("reached_after_s") is not None:
                early[display_name(model)] = None
    return f"{NOTE} Stopped at 90 % in training: {', '.join(early) or 'none'}."


# Panels of the figure: its disturbances with the line of each, its axis and its title.
_PANELS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (
        ("bit_flips", "bit_flips_int8"),
        "flipped bits (%)",
        "flips of bits of the stored model",
    ),
    (("query_flips",), "flipped bits (%)", "flips of bits of the query"),
    (("shift",), "shift (pixels)", "shifts of the camera"),
)
_GROUPS = ("paper", "beyond", "fast")  # of the models that the figure shows
_SHADES = ("#E8924F", "#7A3600")  # of models whose colour another has
_LEAST = 0.05  # percent of flipped bits, where none is drawn


def curves(figure: Figure, rows: pd.DataFrame) -> None:
    """A row a scene, a column a fault, a line a model."""
    scenes = dict(list(rows[_is_drawn(rows)].groupby("scene", sort=False)))
    models = [
        model
        for model in map(str, rows.model.unique())
        if configs.display(model)["group"] in _GROUPS
    ]
    shades = _shades_of(models)
    figure.set_size_inches(7.0, 0.9 + 1.35 * len(scenes))
    grid = figure.subplots(len(scenes), len(_PANELS), sharey=True, squeeze=False)
    for line, (scene, of_scene) in zip(grid, scenes.items(), strict=True):
        table = accuracies(of_scene)
        chance = 100 / of_scene.n_classes.iloc[0]
        for axes, (kinds, _, _) in zip(line, _PANELS, strict=True):
            for kind in kinds:
                for model in models:
                    if model in table:
                        _curve(axes, table, model, kind, shades[model])
            _axis(axes, "shift" in kinds)
            axes.axhline(chance, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
        line[0].set_ylabel(f"{wrapped(scene_name(str(scene)), 22)}\naccuracy (%)")
    for axes, letter, (_, label, title) in zip(grid[0], "abc", _PANELS, strict=True):
        panel(axes, letter, title)
        figure.axes[-len(_PANELS) + "abc".index(letter)].set_xlabel(label)
    handles = [_handle(model, shades[model]) for model in models]
    look: Any = {"color": "0.3", "lw": 0.9, "ls": ":"}
    handles.append(Line2D([], [], label="dotted: weights of 32 bits", **look))
    handles.append(Line2D([], [], color="0.5", lw=0.8, ls=(0, (4, 3)), label="chance"))
    where: Any = {"loc": "outside lower center", "ncols": 4}
    figure.legend(handles=handles, **where)


def _is_drawn(rows: pd.DataFrame) -> pd.Series:
    """Rows of scenes on which bits of the query were flipped."""
    flipped = rows[rows.disturbance == "query_flips"].scene
    return rows.scene.isin(flipped.unique())


def _axis(axes: Axes, is_shift: bool) -> None:
    """The axis of levels: pixels of a shift, percent of flipped bits."""
    axes.set_ylim(0, 103)
    if is_shift:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return
    axes.set_xscale("log")
    axes.set_xticks([_LEAST, 0.1, 1, 10, 30], ["0", "0.1", "1", "10", "30"])
    axes.set_xticks([], minor=True)
    axes.set_xlim(_LEAST / 1.3, 40)


def _curve(
    axes: Axes, table: pd.DataFrame, model: str, kind: str, shade: Mapping[str, Any]
) -> None:
    """Accuracy of a model against the level of a disturbance, from none."""
    of_kind = table[(table.disturbance == kind) & table[model].notna()]
    if not len(of_kind):
        return
    start = table[table.disturbance == "none"]
    # Numbers of 8 bits start from their own rounding, which has a level of 0.
    part = of_kind if (of_kind.level == 0).any() else pd.concat([start, of_kind])
    part = part.sort_values("level")
    scale = LEVELS[kind][2]
    places = scale * part.level.to_numpy(float)
    if kind in FLIPS:
        shown = (places == 0) | (places >= 0.1)
        part = part[shown]
        places = np.maximum(places[shown], _LEAST)
    found = part[[model, f"{model}_low", f"{model}_high"]].to_numpy(float)
    values, spread = errors([Estimate(*line) for line in found], 100)
    in_floats = kind == "bit_flips" and "bit_flips_int8" in _kinds_of(table, model)
    look = dict(shade)
    if in_floats:
        look["ls"] = ":"
    bars(axes, model, places, values, spread, elinewidth=0.5, ms=3.5, **look)


def _shades_of(models: Sequence[str]) -> dict[str, dict[str, Any]]:
    """What the look of each model differs by from its own: a shade, where an earlier one has its
    colour."""
    shades = list(_SHADES)
    found: dict[str, dict[str, Any]] = {}
    colours = set()
    for model in models:
        colour, _, _ = style_of(model)
        found[model] = {}
        if colour in colours and shades:
            shade = shades.pop(0)
            found[model] = {"color": shade, "mfc": shade}
        colours.add(colour)
    return found


def _handle(model: str, shade: Mapping[str, Any]) -> Line2D:
    entry = handle(model)
    entry.set(**shade)
    return entry


def _kinds_of(table: pd.DataFrame, model: str) -> set[str]:
    """Disturbances that a model was measured under."""
    return set(table[table[model].notna()].disturbance)


STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy is left when the frames are disturbed after training, or bits of the stored "
    "model flip? Does hyperdimensional computing tolerate the faults it is said to tolerate?",
    9.5,
    tables=[
        Table(
            "robustness",
            partial(each_scene, accuracies),
            of="robustness",
            key=("scene", "disturbance", "level"),
            title="Test accuracy, %, when something goes wrong after training",
            columns={
                "scene": Column("Scene", scene_name),
                "disturbance": Column("Disturbance", lambda name: LEVELS[name][0]),
                "level": Column("Level", cell=_level),
            },
            note=_note,
        )
    ],
    figures=[
        Plot(
            "robustness",
            curves,
            of="robustness",
            needs=lambda rows: bool(_is_drawn(rows).any()),
            caption="Accuracy that is left, a row a scene: after flips of stored bits (dotted: "
            "weights of 32 bits; the others of 8 bits or as packed), after flips of bits of the "
            "query, and after the camera has moved. Left: undisturbed. Bars: lowest to highest "
            "seed of flips, 95 % intervals of shifts.",
        )
    ],
)
