"""What training on several ranks takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.records.results import Results
from experiments.reporting.study import Study
from experiments.reporting.table import Table, frame, interval, number, size


def tables(results: Results) -> Iterator[Table]:
    """One table, a row for each number of ranks."""
    measured = results.measured("distributed")
    if measured is None:
        return
    config, made = measured.record.config, measured.record.environment
    by_ranks: dict[int, list[dict[str, str]]] = {}
    for line in measured.rows:
        by_ranks.setdefault(int(line["ranks"]), []).append(line)
    rows = [_slowest(ranks, lines) for ranks, lines in by_ranks.items()]
    for row in rows:
        row["speedup"] = rows[0]["seconds"] / row["seconds"]
    same = len({line["prototypes_sha256"] for line in measured.rows}) == 1
    yield Table(
        "distributed",
        f"Training on several ranks: N = {config['n']} frames of noise, "
        f"{' × '.join(map(str, config['shape']))} pixels, L = {config['classes']} classes. "
        f"{made.cpu}, {made.cores} cores, a thread a rank.",
        frame(rows),
        {
            "Ranks": lambda row: str(row["ranks"]),
            "Frames a rank": lambda row: str(row["frames"]),
            "Counting, ms": lambda row: _milliseconds(row, "count"),
            "Adding and waiting, ms": lambda row: _milliseconds(row, "add"),
            "Both, ms": lambda row: number(1e3 * row["seconds"]),
            "Speed-up": lambda row: number(row["speedup"]),
            "Sent a rank": lambda row: size(row["bytes"]),
        },
        "The rank that takes longest; medians with quartiles over "
        f"{config['repeats']} repeats. Counts are added by gloo, on one machine. Prototypes of all "
        f"ranks and of one alone are {'the same bit for bit' if same else 'NOT the same'}.",
        [measured.record.command],
    )


def _slowest(ranks: int, lines: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """The row of the rank that takes longest, with numbers as numbers."""
    line = max(lines, key=lambda line: float(line["seconds"]))
    times = {key: float(text) for key, text in line.items() if key.endswith("_s")}
    largest = max(int(line["frames"]) for line in lines)
    sent = int(line["bytes"])
    return {
        "ranks": ranks,
        "frames": largest,
        **times,
        "seconds": float(line["seconds"]),
        "bytes": sent,
    }


def _milliseconds(row: Mapping[str, Any], what: str) -> str:
    keys = (f"{what}_median_s", f"{what}_q25_s", f"{what}_q75_s")
    return interval(*(number(1e3 * row[key]) for key in keys))


STUDY = Study(
    "ranks",
    "Several ranks",
    "What does training on several processes or machines take, and are the prototypes the same?",
    14,
    tables,
)
