"""Accuracy that is left under disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import Estimate, mean_share
from experiments.reporting.study import Study
from experiments.reporting.text import size

STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy is left when the frames are disturbed after training, or bits of the stored "
    "model flip? Does hyperdimensional computing tolerate the faults it is said to tolerate?",
    9.5,
)
FLIPS = ("bit_flips", "bit_flips_int8")
# Name of a disturbance, unit of its level, and the number of units in a level of 1.
LEVELS = {
    "none": ("none", "", 1),
    "power": ("laser power ±", "%", 100),
    "dead_pixels": ("dead pixels", "%", 100),
    "shift": ("camera shifted", "px", 1),
    "bit_flips": ("bit error rate", "", 1),
    "bit_flips_int8": ("bit error rate, 8-bit numbers", "", 1),
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
    "In brackets: Student, 95 %, over seeds; of bit error rates the lowest and the highest draw. "
    "Bit error rate: of the bytes of every stored tensor but the labels of nearest neighbour. "
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


@STUDY.table(
    "robustness",
    of="robustness",
    key=("disturbance", "level"),
    title="Test accuracy, %, when something goes wrong after training, on {frames}",
    columns={
        "disturbance": Column("Disturbance", lambda name: LEVELS[name][0]),
        "level": Column("Level", cell=_level),
    },
)
def disturbed(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """Accuracy of each model, a column, under each disturbance."""
    table = accuracies(rows)
    models = list(rows.model.unique())
    sizes = rows.groupby("model", sort=False).model_bytes.first()
    stored = "; ".join(
        f"{display_name(str(m))} {size(int(n))}" for m, n in sizes.items()
    )
    stops = config.get("stops", {})
    early = [m for m in models if stops.get(m, {}).get("reached_after_s") is not None]
    stopped = ", ".join(map(display_name, early)) or "none"
    table.attrs["note"] = (
        f"{NOTE} Stored: {stored}. Stopped at 90 % in training: {stopped}."
    )
    return table
