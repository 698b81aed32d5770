"""Routes of the benchmark: their medians and ratios."""

from __future__ import annotations

import math

import pandas as pd

from experiments.reporting.table import records

HEADLINE = {"n": 400, "d": 250_000, "l": 5}


def of_route(
    rows: pd.DataFrame, operation: str, route: str, **sizes: int
) -> dict[str, float]:
    """Median and ratio of a route at these sizes, NaN where it was not measured.

    A size that is not given is the headline's, or the only one that was measured.
    """
    rows = rows[(rows["operation"] == operation) & (rows["route"] == route)]
    for key, value in (HEADLINE | sizes).items():
        if key in sizes or rows[key].nunique() > 1:
            rows = rows[rows[key] == value]
    row = records(rows)[0] if len(rows) else {}
    return {key: row.get(key) or math.nan for key in ("median_s", "ratio_to_ours")}
