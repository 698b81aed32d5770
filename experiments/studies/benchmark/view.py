"""Routes of the classifier beside their peers: at the headline size, and against goals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments.records.results import Group, Results
from experiments.reporting.columns import Column, milliseconds
from experiments.reporting.study import Study
from experiments.reporting.table import records
from experiments.studies.benchmark import names
from experiments.studies.benchmark.names import OPERATIONS, OURS_COMPILED

ORDINARY = "HDC by ordinary routes"
HEADLINE = {"n": 400, "d": 250_000, "l": 5}
NOTE = (
    "The routes of a size ran in turns in one process; × hdc is the median over the turns. "
    "Results were compared before any timing with a reference in plain NumPy: “yes, ties aside” "
    "means that only bits differ which the median or the majority leaves open, “same labels” that "
    "frames not learnt were recognised. Frames: speckle in uint8. "
    '“hdc, compiled” is HDCClassifier(backend="compiled").'
)
GOALS: tuple[tuple[str, tuple[str, str], str, float], ...] = (
    # operation, (numerator, denominator), bound, limit
    ("bundle", (names.TORCHHD_BUNDLE, OURS_COMPILED), "≥", 200),
    ("train", (names.TORCHHD_TRAIN, OURS_COMPILED), "≥", 80),
    ("train", (OURS_COMPILED, names.READ), "≤", 1.15),
    ("train", (OURS_COMPILED, names.COPY), "≤", 1),
    ("hamming", (OURS_COMPILED, names.NUMKONG), "≤", 1.1),
    ("folder", (names.DECODE_IMAGES, OURS_COMPILED), "≥", 0.9),
)

STUDY = Study(
    "benchmark",
    "Speed",
    "How fast is each step of the classifier, beside other libraries that do the same on the same "
    "bytes?",
    order=12,
)


def _median(row: Mapping[str, Any]) -> str:
    return row["status"] if row["status"] != "ok" else milliseconds(row["median_s"])


SHOWN = {
    "predict": "predict, one frame",
    "folder": "train, PNG images",
    "video": "train, video",
}
COLUMNS = {
    "operation": Column("Operation", lambda name: SHOWN.get(name, name)),
    "route": Column("Route"),
    "n": Column("N"),
    "median_s": Column("Median, ms", cell=_median),
    "ratio_to_ours": Column("× hdc"),
    "equal_result": Column("Same result"),
}


@STUDY.table(
    "benchmark_goals",
    of="benchmark",
    title="Goals of the classifier, N = 400, D = 250,000. {machine}",
    note=NOTE,
)
def goals(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """What was to be reached, as far as it was measured."""
    single = of_route(rows, "predict", OURS_COMPILED)
    table = [
        ("predict one frame: hdc, compiled, ms", "≤", 0.12, 1e3 * single["median_s"])
    ]
    for operation, pair, bound, limit in GOALS:
        # Both were timed in turns with ours.
        over, under = (
            of_route(rows, operation, route)["ratio_to_ours"] for route in pair
        )
        table.append(
            (f"{operation}: {pair[0]}, × {pair[1]}", bound, limit, over / under)
        )
    return pd.DataFrame(
        [
            {
                "Goal": goal,
                "Wanted": f"{bound} {limit:g}",
                "Measured": float(value),
                "Met": "yes"
                if (value >= limit if bound == "≥" else value <= limit)
                else "no",
            }
            for goal, bound, limit, value in table
            if not math.isnan(value)
        ]
    )


@STUDY.table(
    "benchmark",
    of="benchmark",
    title="Routes beside their peers: N = 400 frames, D = 250,000 pixels, L = 5. {machine}",
    shown=tuple(COLUMNS),
    columns=COLUMNS,
    note=NOTE,
)
def headline(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The rows of the headline size; of operations on other numbers of frames, theirs."""
    rows = rows[rows["operation"].isin(OPERATIONS)]
    rows = rows[(rows["d"] == HEADLINE["d"]) & (rows["l"] == HEADLINE["l"])]
    other_n = ~rows["operation"].isin(["encode", "bundle", "train"])
    rows = rows[other_n | (rows["n"] == HEADLINE["n"])]
    return rows.sort_values(
        "operation", key=lambda x: x.map(OPERATIONS.index), kind="stable"
    )


def ordinary_training_s(results: Results, group: Group) -> float | None:
    """Seconds in which the faster of the ordinary routes makes prototypes of as many frames as a
    group's, on its processor and as many threads; None where that was not measured."""
    measured = results.measured("benchmark")
    if measured is None or not group.runs:
        return None
    record, made_on = group.runs[0].record, measured.record.environment
    if (made_on.cpu, made_on.threads) != (
        record.environment.cpu,
        record.environment.threads,
    ):
        return None
    sizes = {
        "n": record.n_train,
        "d": math.prod(record.scene.shape),
        "l": len(group.classes),
    }
    rows = (
        of_route(measured.frame, "train", route, **sizes)
        for route in names.ORDINARY_ROUTES
    )
    seconds = [
        float(row["median_s"]) for row in rows if not math.isnan(row["median_s"])
    ]
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
