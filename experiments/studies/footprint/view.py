"""Time, memory and modules of each scene and model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from experiments.records.results import own_columns
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table
from experiments.reporting.text import size
from experiments.studies.footprint.probe import WATCHED

COLUMNS = {
    "first_prediction_s": Column("First prediction, s"),
    "torch_s": Column("of it importing torch, s"),
    "peak_bytes": Column("Peak memory", lambda value: size(int(value))),
    "loaded": Column("Loaded of those watched", note=f"Watched: {', '.join(WATCHED)}."),
}


def footprint(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """A row a process."""
    return own_columns(rows)


LOADED, LEFT_OUT, TOO_MUCH = "loaded", "left out", "not needed"
_SIGNS = {LOADED: "loaded", LEFT_OUT: "·", TOO_MUCH: "**not needed**"}


def cell(row: Mapping[str, Any], module: str) -> str:
    """State of a watched module in a process: left out, loaded, or loaded and not needed."""
    if module not in str(row["loaded"]).split():
        return LEFT_OUT
    _, failed, modules = str(row["status"]).partition("fails: loads ")
    return TOO_MUCH if failed and module in modules.split(", ") else LOADED


def matrix(rows: pd.DataFrame) -> pd.DataFrame:
    """A row a process that ran, a column a watched module."""
    lines = []
    for row in rows[rows.loaded.notna()].to_dict("records"):
        line = {"scene": row["scene"], "model": row["model"]}
        line |= {module: cell(row, module) for module in WATCHED}
        lines.append(line)
    return pd.DataFrame(lines)


def left_out(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """A row a process."""
    return matrix(rows)


_COLOURS = {LEFT_OUT: "#EEEEEE", LOADED: "#0072B2", TOO_MUCH: "#D55E00"}


def picture(
    figure: Figure,
    rows: pd.DataFrame,
) -> None:
    """A row per scene, a column per module."""
    of_hdc = rows[(rows.model == "hdc") & rows.loaded.notna()]
    table = matrix(of_hdc)
    axes = figure.subplots()
    for y, line in enumerate(table.to_dict("records")):
        for x, module in enumerate(WATCHED):
            square = Rectangle(
                (x - 0.45, y - 0.45), 0.9, 0.9, fc=_COLOURS[line[module]]
            )
            axes.add_patch(square)
    for y, peak in enumerate(of_hdc.peak_bytes):
        axes.text(len(WATCHED) - 0.3, y, size(int(peak)), va="center", fontsize=6)
    axes.text(len(WATCHED) - 0.3, -0.55, "peak", va="bottom", fontsize=6)
    axes.set(xlim=(-0.5, len(WATCHED) + 1.5), ylim=(len(table) - 0.5, -0.5))
    axes.set_xticks(range(len(WATCHED)), WATCHED, rotation=90, fontsize=6)
    axes.set_yticks(range(len(table)), [scene_name(name) for name in table.scene])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    present = set(table[list(WATCHED)].to_numpy().ravel())
    handles = [
        Patch(color=colour, label=found)
        for found, colour in _COLOURS.items()
        if found in present
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)


STUDY = Study(
    "footprint",
    "Footprint",
    "How much memory does each scene and model take, and does it load only what it needs?",
    order=13,
    tables=[
        Table(
            "footprint",
            footprint,
            of="footprint",
            title="Footprint of each scene and model. {machine}",
            shown=("scene", "model", *COLUMNS, "status"),
            columns=COLUMNS,
            note="Every row is a process of its own: scene and model built, ten frames made and "
            "learnt, one predicted. The sensor is simulated, the matrices of the fibre are "
            "measured.",
        ),
        Table(
            "footprint_left_out",
            left_out,
            of="footprint",
            key=("scene", "model"),
            title="Modules that each scene and model leaves out",
            columns={
                module: Column(module, lambda found: _SIGNS[found])
                for module in WATCHED
            },
            note="A dot: the module is left out. Every row is a process of its own. A module "
            "that is loaded and that neither the scene nor the model needs is a failure.",
        ),
    ],
    figures=[
        Plot(
            "footprint",
            picture,
            of="footprint",
            size=(3.4, 3.2),
            caption="Modules that one process loads to learn a scene and predict with HDC. "
            "Columns: modules that some part of the project needs. Right: peak "
            "memory.",
            needs=lambda rows: bool(
                ((rows.model == "hdc") & rows.loaded.notna()).any()
            ),
        )
    ],
)
