"""Numbers at their limits: every case with both errors, both times and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.measured import machine
from experiments.reporting.study import Study
from experiments.reporting.table import Table, cell, frame, number

_NUMBERS = ("error_naive", "error_ours", "tolerance", "time_naive_s", "time_ours_s")


def tables(results: Results) -> Iterator[Table]:
    """One table, a row a case."""
    measured = results.measured("stability")
    if measured is None or not measured.rows:
        return
    rows = [
        {key: float(text) if key in _NUMBERS else text for key, text in row.items()}
        for row in measured.rows
    ]
    holding = sum(row["verdict"] == "holds" for row in rows)
    yield Table(
        "stability",
        f"Numbers at their limits: {holding} of {len(rows)} cases hold",
        frame(rows),
        {
            "Part": cell("part"),
            "Case": cell("case"),
            "What is extreme": cell("extreme"),
            "Expected": cell("expected"),
            "Reference": cell("reference"),
            "Obvious method": cell("naive"),
            "Ours": cell("ours"),
            "Error in": cell("unit"),
            "Error, obvious": lambda row: _error(row["error_naive"]),
            "Error, ours": lambda row: _error(row["error_ours"]),
            "Tolerance": lambda row: _error(row["tolerance"]),
            "Time, obvious, ms": lambda row: number(1e3 * row["time_naive_s"]),
            "Time, ours, ms": lambda row: number(1e3 * row["time_ours_s"]),
            "Verdict": cell("verdict"),
        },
        _note(measured),
        [measured.record.command],
    )


def _note(measured: Measured) -> str:
    """How to read the table, and what the cases themselves remark."""
    told = [f"{key}={value}" for key, value in measured.overrides.items()]
    sentences = [
        "The same input the obvious way and ours, against an exact reference; a case holds if our "
        "error is within the tolerance",
        f"Times are the least of some repeats on {machine(measured)}",
        *([f"Measured with {', '.join(told)}"] if told else []),
        *(f"{row['case']}: {row['note'].rstrip('.')}" for row in measured.rows if "note" in row),
    ]
    return ". ".join(text[0].upper() + text[1:] for text in sentences) + "."


def _error(value: Any) -> str:
    """An error: NaN (None in a row) is told from no result at all."""
    if value is None:
        return "NaN"
    if math.isinf(value):
        return "no result"
    # Counts are written out.
    return f"{value:,.0f}" if value.is_integer() and value < 1e6 else number(value, 2)


STUDY = Study(
    "stability",
    "Numbers at their limits",
    "Where do the obvious formulas lose their digits, and do ours keep them there, at what cost?",
    9,
    tables,
)
