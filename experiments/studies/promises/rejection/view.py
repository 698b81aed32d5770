"""How many known and unknown frames are refused, and how well distances tell them apart."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.estimates import mean_interval, mean_share
from experiments.reporting.table import Table
from experiments.reporting.text import percent

ROW = ["seed", "draw", "left_out"]
"""Columns that name a row of a model; a line is a group of one."""


def rejection(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene and model."""
    lines = []
    for (scene, model), rows in frame.groupby(["scene", "model"], sort=False):
        lines.append({"recording": scene, "model": model, **shares(rows)})
    return pd.DataFrame(lines)


def shares(lines: pd.DataFrame) -> dict[str, Any]:
    """Shares of refused frames and areas of one model on one scene, with their intervals."""
    groups = lines.groupby(["seed", "group"])[["known", "refused"]].sum()
    of_groups = (groups.refused / groups.known).tolist()
    rows = lines.drop_duplicates(ROW)
    of_rows = (rows.unknown_refused / rows.unknown).tolist()
    found = {
        "refused": mean_share(of_groups, float(lines.known.mean())),
        "unknown_refused": mean_share(of_rows, float(rows.unknown.mean())),
    }
    for name in ("area", "area_of_scores"):
        found[name] = mean_interval(rows[name].tolist()).within(0, 1)
    cells: dict[str, Any] = {"alpha": float(lines.alpha.iloc[0])}
    for name, estimate in found.items():
        cells |= estimate.columns(name)
    return cells


TABLE = Table(
    "rejection",
    rejection,
    of="rejection",
    title="Known and unknown frames that is_known refuses, on groups that training has not seen",
    key=("recording", "model"),
    columns={
        "recording": Column("Data set", scene_name),
        "alpha": Column("Asked: known frames refused, %", percent),
        "refused": Column("Known frames refused, %", percent),
        "unknown_refused": Column("Unknown frames refused, %", percent),
        "area": Column("Area under the curve, distance"),
        "area_of_scores": Column("Area under the curve, class score"),
    },
    note="Classes are left out of the training in turn, and their test frames are unknown. Known "
    "test frames are of groups (objects, sessions, grasps, positions) without training frames, and "
    "is_known is calibrated by the groups of the training frames. Area under the curve of unknown "
    "against known frames: 1 if they are apart, 0.5 by chance. Distance: to the nearest class, as "
    "is_known compares it. Class score: the largest of the read-out. Shares of known frames are "
    "means over groups, all others over draws and classes left out; brackets: Student, 95 %, over "
    "the same.",
)
