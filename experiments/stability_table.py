"""The table of numbers at their limits, from the measurement ``stability``: CSV and Markdown."""

from __future__ import annotations

import math
from pathlib import Path

from experiments.measurement import Measured, read, to_csv
from experiments.record import write_atomically

Row = dict[str, str]

COLUMNS = (
    "part", "case", "extreme", "expected", "reference", "unit", "naive", "ours", "error_naive",
    "error_ours", "tolerance", "time_naive_s", "time_ours_s", "verdict", "note",
)  # fmt: skip
_NUMBERS = ("error_naive", "error_ours", "tolerance", "time_naive_s", "time_ours_s")
_HEADS = (
    "Case", "What is extreme", "Expected", "Reference", "Obvious method", "Ours", "Error in",
    "Error, obvious", "Error, ours", "Tolerance", "Time, obvious", "Time, ours", "Verdict",
)  # fmt: skip


def tables(results: Path) -> list[Path]:
    """Write tables/stability.csv and .md of a results folder; nothing without the measurement."""
    measured = read(results, "stability")
    if measured is None or not measured.rows:
        return []
    paths = [results / "tables" / f"stability.{kind}" for kind in ("csv", "md")]
    for path, text in zip(paths, (to_csv(rows(measured)), to_markdown(measured)), strict=True):
        write_atomically(path, text)
    return paths


def rows(measured: Measured) -> list[Row]:
    """One row a case, all of :data:`COLUMNS`; numbers with three digits, times in s."""
    return [
        {name: f"{float(row[name]):.3g}" if name in _NUMBERS else row.get(name, "")
         for name in COLUMNS}
        for row in measured.rows
    ]  # fmt: skip


def to_markdown(measured: Measured) -> str:
    """What was found in a sentence, then for each part a table and notes."""
    blocks = [_summary(measured)]
    for part in dict.fromkeys(row["part"] for row in measured.rows):
        mine = [row for row in measured.rows if row["part"] == part]
        table = [list(_HEADS), ["---"] * len(_HEADS), *map(_cells, mine)]
        blocks.append(f"**{part.capitalize()}**")
        blocks.append("\n".join(f"| {' | '.join(cells)} |" for cells in table))
        blocks.append("\n".join(_note(row) for row in mine if "note" in row))
    return "\n\n".join(block for block in blocks if block) + "\n"


def _summary(measured: Measured) -> str:
    machine = measured.record["environment"]
    failing = [row["case"] for row in measured.rows if row["verdict"] != "holds"]
    count = f"{len(measured.rows)} cases, {len(measured.rows) - len(failing)} hold"
    if failing:
        count += f", {len(failing)} fail ({', '.join(failing)})"
    text = (
        f"**Numbers at their limits: {count}.** The same input the obvious way and ours; errors "
        "against an exact reference. A case holds if our error is within the tolerance. Times are "
        f"the least of some repeats on {machine['cpu']}, {machine['threads']} threads."
    )
    if measured.record["config"]["small"]:
        text += " Small sizes, for a quick look."
    if measured.record["status"] != "finished":
        text += f" The measurement is {measured.record['status']}: cases are missing."
    if measured.outdated:
        text += f" Code has changed since: {', '.join(measured.outdated)}."
    return text


def _cells(row: Row) -> list[str]:
    words = [_escaped(row[name]) for name in
             ("case", "extreme", "expected", "reference", "naive", "ours", "unit")]  # fmt: skip
    errors = [_number(row[name]) for name in ("error_naive", "error_ours", "tolerance")]
    times = [_time(row[name]) for name in ("time_naive_s", "time_ours_s")]
    end = row["verdict"] if row["verdict"] == "holds" else f"**{row['verdict']}**"
    return [*words, *errors, *times, end]


def _note(row: Row) -> str:
    return f"- {_escaped(row['case'])}: {_escaped(row['note'].rstrip('.'))}."


def _escaped(text: str) -> str:
    """Text in which no sign means anything to Markdown."""
    return "".join(f"\\{sign}" if sign in "\\|~<>[]_*`" else sign for sign in text)


def _number(text: str) -> str:
    value = float(text)
    if math.isinf(value):
        return "no result"
    if math.isnan(value):
        return "NaN"
    # Counts are written out.
    return f"{value:,.0f}" if value.is_integer() and value < 1e6 else f"{value:.2g}"


def _time(text: str) -> str:
    seconds = float(text)
    unit, scale = next(
        (pair for pair in (("s", 1.0), ("ms", 1e-3)) if seconds >= pair[1]), ("µs", 1e-6)
    )
    value = seconds / scale
    return f"{value:.1f} {unit}" if value < 9.95 else f"{value:.0f} {unit}"
