"""Time, memory and modules of each scene and model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments.reporting.columns import Column
from experiments.reporting.study import Study
from experiments.reporting.text import size
from experiments.studies.footprint.probe import WATCHED

STUDY = Study(
    "footprint",
    "Footprint",
    "How much memory does each scene and model take, and is what it does not need left out?",
    order=13,
)
COLUMNS = {
    "first_prediction_s": Column("First prediction, s"),
    "torch_s": Column("of it importing torch, s"),
    "peak_bytes": Column("Peak memory", lambda value: size(int(value))),
    "loaded": Column("Loaded of those watched", note=f"Watched: {', '.join(WATCHED)}."),
}


@STUDY.table(
    "footprint",
    of="footprint",
    title="Footprint of each scene and model. {machine}",
    shown=("scene", "model", *COLUMNS, "status"),
    columns=COLUMNS,
    note="Every row is a process of its own: scene and model built, ten frames made and learnt, "
    "one predicted. The sensor is simulated, the matrices of the fibre are measured.",
)
def footprint(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """A row a process."""
    return rows
