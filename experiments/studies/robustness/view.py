"""Accuracy that is left under disturbances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.estimates import mean_share
from experiments.reporting.facets import facets
from experiments.reporting.plot import DASHED, handle, legend_below, wrapped
from experiments.reporting.resamples import models_of
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import percent
from experiments.reporting.trained import split_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

BY = ["scene", "model", "disturbance", "level", "n_classes"]
# Columns of the table, by disturbance and level.
HEADS = {
    "none_0": "Undisturbed, %",
    "dither_1": "±1 grey level, %",
    "shift_1": "Shifted by a pixel, %",
    "bit_flips_0.1": "10 % of stored bits flipped, %",
    "bit_flips_int8_0.1": "of 8-bit weights, %",
}
# Panels of the figure, by disturbance: label of the axis.
PANELS = {
    "dither": "dither (± grey levels)",
    "shift": "camera shifted (pixels)",
    "bit_flips": "stored bits flipped (%)",
}


def left(frame: pd.DataFrame) -> pd.DataFrame:
    """The ``accuracy`` of each group of :data:`BY`, mean over seeds with Student's interval."""
    lines = []
    for key, same in frame.groupby(BY, sort=False):
        shares = (same.right / same.n_test).tolist()
        found = mean_share(shares, same.n_test.iloc[0])
        lines.append(dict(zip(BY, key, strict=True)) | found.columns("accuracy"))
    return pd.DataFrame(lines)


def robustness(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model, a column per disturbance and level."""
    rows: dict[Any, dict[str, Any]] = {}
    for line in left(frame).to_dict("records"):
        key = {name: line[name] for name in ("scene", "model")}
        row = rows.setdefault(tuple(key.values()), key)
        name = f"{line['disturbance']}_{line['level']:g}"
        row |= {f"{name}{end}": line[f"accuracy{end}"] for end in ENDS}
    return pd.DataFrame(rows.values())


def levels(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per panel, model and level; of weights stored in 32 and in 8 bits those in 8 bits."""
    splits = {scene: split_of(rows) for scene, rows in frame.groupby("scene")}
    every = left(frame).assign(split=lambda lines: lines.scene.map(splits))
    parts = []
    for name in PANELS:
        of_int8 = every[every.disturbance == f"{name}_int8"]
        others = every[every.disturbance.isin(("none", name))]
        parts.append(pd.concat([of_int8, others]).assign(panel=name))
    return pd.concat(parts).drop_duplicates(["scene", "model", "level", "panel"])


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A row per scene, a column per disturbance, a line per model."""
    models = models_of(data)
    figure.set_size_inches(7.0, 1.2 + 1.35 * data.scene.nunique())
    names = ("level", "accuracy", "model", "scene", "panel")
    panels = facets(figure, data, *names, scale=100, sharex="col", sharey=True)
    for (scene, name), axes in panels.items():
        axes.set(xlabel=PANELS[name], ylim=(0, 103))
        of_scene = data[data.scene == scene]
        split = wrapped(of_scene.split.iloc[0], 26)
        axes.set_ylabel(f"{wrapped(scene_name(scene), 22)},\n{split}\naccuracy (%)")
        axes.label_outer()
        axes.axhline(100 / of_scene.n_classes.iloc[0], **DASHED)
        if name == "bit_flips":
            axes.set_xscale("symlog", linthresh=0.001)
            axes.set_xlim(-0.0002, 0.5)
            axes.set_xticks([0, 0.001, 0.01, 0.1, 0.3], ["0", "0.1", "1", "10", "30"])
            axes.set_xticks([], minor=True)
    legend_below(figure, map(handle, models), len(models))


NOTE = (
    "±1 grey level: −1, 0 or 1 is added to each pixel, as another conversion to grey may do. "
    "Stored bits: of every stored tensor, of LDA except its scale and offset per class. 8-bit "
    "weights: every float32 was rounded to one of 255 equal steps before. In brackets: Student, "
    "95 %, over seeds. –: not measured yet. The CSV has every level."
)
STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy remains when frames are disturbed after training, or bits of the "
    "stored model flip?",
    9.5,
    tables=[
        Table(
            "robustness",
            robustness,
            of="robustness",
            key=("scene", "model"),
            title="Test accuracy under disturbances after training",
            shown=("scene", "model", *HEADS),
            columns={name: Column(head, percent) for name, head in HEADS.items()},
            note=NOTE,
        ),
    ],
    figures=[
        Figure(
            "robustness",
            Table("robustness_levels", levels, of="robustness"),
            draw,
            title="Accuracy under disturbances after training, by data set and split",
            details="Dashed: chance. Bars: 95 % intervals over seeds.",
            caption="Accuracy that remains, a row of panels per data set. From left to right: "
            "dither of the test frames; the camera has moved; flips of bits of the stored model, "
            "whose weights have 8 bits. Leftmost point: no disturbance. "
            "0 %: the damaged model gives no answer. Rows in which all models begin at 100 % are "
            "saturated and rank no models.",
        )
    ],
)
