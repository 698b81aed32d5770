"""Numbers at their limits: every case with both errors and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments.reporting.columns import Column
from experiments.reporting.study import Study
from experiments.reporting.text import number

STUDY = Study(
    "stability",
    "Numbers at their limits",
    "Where do the obvious formulas lose their digits, and do ours keep them?",
    order=9,
)


def error(value: float) -> str:
    """An error; counts are written out."""
    return f"{value:,.0f}" if value == int(value) and value < 1e6 else number(value, 2)


COLUMNS = {
    "part": Column("Part"),
    "case": Column("Case"),
    "extreme": Column("Why it is extreme"),
    "naive": Column("Obvious computation"),
    "ours": Column("Ours"),
    "unit": Column("Error in"),
    "error_naive": Column("Error, obvious", error, note="A dash: no number came out."),
    "error_ours": Column("Error, ours", error),
    "tolerance": Column("Tolerance", error),
}


@STUDY.table(
    "stability",
    of="stability",
    title="Numbers at their limits",
    columns=COLUMNS,
    note="The same input, computed the obvious way and ours, against an exact reference. A case "
    "holds if our error is within the tolerance.",
)
def stability(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """One row per case."""
    holding = (rows["verdict"] == "holds").sum()
    rows.attrs["title"] = (
        f"Numbers at their limits: {holding} of {len(rows)} cases hold"
    )
    return rows
