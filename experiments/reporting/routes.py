"""Routes of the benchmark: their medians, and the time of the ordinary ones, of other libraries."""

from __future__ import annotations

import math

import pandas as pd

from experiments.records.results import Group, Results
from experiments.reporting.table import records

# As the benchmark names them: medians by a standard library, then the majority by torchhd.
ORDINARY_ROUTES = (
    "torch.median, torchhd.multiset",
    "numpy.median, torchhd.multiset",
)
ORDINARY = "HDC by ordinary routes"
HEADLINE = {"n": 400, "d": 250_000, "l": 5}


def ordinary_training_s(results: Results, group: Group) -> float | None:
    """Seconds in which the faster of the ordinary routes makes prototypes of as many frames as a
    group's, on its processor and as many threads; None where that was not measured."""
    measured = results.measured("benchmark")
    if measured is None or not group.runs:
        return None
    record, made_on = group.runs[0].record, measured.record.environment
    machine = (record.environment.cpu, record.environment.threads)
    if (made_on.cpu, made_on.threads) != machine:
        return None
    sizes = {
        "n": record.n_train,
        "d": math.prod(record.scene.shape),
        "l": len(group.classes),
    }
    seconds = []
    for route in ORDINARY_ROUTES:
        median = of_route(measured.frame, "train", route, **sizes)["median_s"]
        if not math.isnan(median):
            seconds.append(median)
    return min(seconds, default=None)


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
