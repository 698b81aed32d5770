"""Routes of the classifier beside their peers: at the headline size, and against goals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments.records.results import own_columns
from experiments.reporting.columns import Column, milliseconds
from experiments.reporting.study import Study
from experiments.reporting.table import Table
from experiments.studies.benchmark import names
from experiments.studies.benchmark.names import OPERATIONS, OURS_COMPILED
from experiments.studies.benchmark.table import HEADLINE, of_route

NOTE = (
    "The routes of a size ran in interleaved repetitions in one process; × hdc is the "
    "median over the repetitions. Results were compared before any timing with a "
    "reference in plain NumPy: “yes, ties aside”: only bits differ that the median or the "
    "majority leaves open; “same labels”: new frames were recognised. Frames: speckle in "
    'uint8. “hdc, compiled” is HDCClassifier(backend="compiled").'
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


def goals(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """Goals, as far as they were measured."""
    single = of_route(rows, "predict", OURS_COMPILED)
    name = "predict one frame: hdc, compiled, ms"
    table = [_goal(name, "≤", 0.12, 1e3 * single["median_s"])]
    for operation, pair, bound, limit in GOALS:
        # Both were timed in interleaved repetitions with ours.
        over = of_route(rows, operation, pair[0])["ratio_to_ours"]
        under = of_route(rows, operation, pair[1])["ratio_to_ours"]
        name = f"{operation}: {pair[0]}, × {pair[1]}"
        table.append(_goal(name, bound, limit, over / under))
    return pd.DataFrame([line for line in table if not math.isnan(line["Measured"])])


def _goal(
    name: str,
    bound: str,
    limit: float,
    value: float,
) -> dict[str, Any]:
    """A row: what was wanted, what was measured, and whether it was met."""
    met = value >= limit if bound == "≥" else value <= limit
    return {
        "Goal": name,
        "Wanted": f"{bound} {limit:g}",
        "Measured": float(value),
        "Met": "yes" if met else "no",
    }


def headline(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """The rows of the headline size; of operations on other numbers of frames, theirs."""
    rows = own_columns(rows)
    rows = rows[rows["operation"].isin(OPERATIONS)]
    rows = rows[(rows["d"] == HEADLINE["d"]) & (rows["l"] == HEADLINE["l"])]
    other_n = ~rows["operation"].isin(["encode", "bundle", "train"])
    rows = rows[other_n | (rows["n"] == HEADLINE["n"])]
    return rows.sort_values(
        "operation", key=lambda x: x.map(OPERATIONS.index), kind="stable"
    )


STUDY = Study(
    "benchmark",
    "Speed",
    "How fast is each step of the classifier, beside other libraries that do the same on the same "
    "bytes?",
    order=12,
    tables=[
        Table(
            "benchmark_goals",
            goals,
            of="benchmark",
            title="Goals of the classifier, N = 400, D = 250,000. {machine}",
            note=NOTE,
        ),
        Table(
            "benchmark",
            headline,
            of="benchmark",
            title="Routes beside their peers: N = 400 frames, D = 250,000 pixels, L = 5. {machine}",
            shown=tuple(COLUMNS),
            columns=COLUMNS,
            note=NOTE,
        ),
    ],
)
