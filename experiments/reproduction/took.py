"""What each step took, in ``reproduce.csv``: its calls added up, and its largest memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.reproduction.steps import LANES, plain
from hdc.io import write_atomically

FILE = "reproduce.csv"
FINISHED, INTERRUPTED = "finished", "interrupted"


def note(results: Path, row: dict[str, Any]) -> None:
    """Put a call of a step into its row of reproduce.csv.

    Seconds of calls that broke off add up with those of the call that finished the step. Of calls
    after that the longest counts, as the others found work done, and one that breaks off changes
    nothing: the step stays finished. The memory is the largest of all. Another command begins anew,
    another launcher does not.
    """
    rows = read(results)
    known = rows.get((row["step"], row["mode"]))
    if known and plain(known["command"]) == plain(row["command"]):
        before = float(known["seconds"])
        if known["status"] != FINISHED:
            row["seconds"] += before
        elif row["status"] == FINISHED:
            row["seconds"] = max(row["seconds"], before)
        else:
            return
        row["peak_bytes"] = max(row["peak_bytes"], int(known["peak_bytes"]))
    rows[row["step"], row["mode"]] = row
    write(results, rows.values())


def wall_seconds(row: Mapping[str, Any]) -> float:
    """Share of a step in the time that the whole took: two lanes ran at a time, or one."""
    lanes = row.get("lanes")
    if lanes is None or lanes != lanes:  # of a row written before there were lanes
        lanes = LANES if "exclusive=false" in row["command"] else 1
    return float(row["seconds"]) / float(lanes)


def write(results: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write reproduce.csv."""
    text = pd.DataFrame(list(rows)).to_csv(index=False, lineterminator="\n")
    write_atomically(results / FILE, text)


def read(results: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """Rows of reproduce.csv by step and mode."""
    path = results / FILE
    if not path.is_file():
        return {}
    rows = pd.read_csv(path).to_dict("records")
    return {(row["step"], row["mode"]): row for row in rows}
