"""Cost of each step, in ``reproduce.csv``: its calls added up, and its largest memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.records import locks, store
from hdc.io import write_atomically

FILE = "reproduce.csv"
FINISHED, INTERRUPTED = "finished", "interrupted"

Call = dict[str, Any]
"""A line of reproduce.csv, by column."""


def begin(results: Path, row: Call) -> Call | None:
    """Put a call of a step that begins into reproduce.csv, as one that broke off: so it stays after
    a kill. Returns the row of earlier calls, if there were any."""
    key = row["step"], row["mode"]
    with changing(results) as rows:
        known = rows.get(key)
        if known and known["command"] != row["command"]:
            known = None  # another command begins anew
        if not _is_whole(known, row):
            rows[key] = {**row, "status": INTERRUPTED}
            if known:
                rows[key] |= {name: known[name] for name in ("seconds", "peak_bytes")}
    return known


def end(results: Path, row: Call, known: Call | None) -> None:
    """Put a call of a step that has ended into its row of reproduce.csv.

    Seconds of calls that broke off add up with those of the call that finished the step. Of calls
    after that the longest counts, as the others found work done, and one of the same commit that
    breaks off changes nothing: the step stays finished. The memory is the largest of all.

    Args:
        results: folder of own results.
        row: of the call.
        known: of the calls before, as :func:`begin` returned it.
    """
    if known and row["status"] != FINISHED and _is_whole(known, row):
        return
    if known:
        before = float(known["seconds"])
        if known["status"] != FINISHED:
            row["seconds"] += before
        else:
            row["seconds"] = max(row["seconds"], before)
        row["peak_bytes"] = max(row["peak_bytes"], int(known["peak_bytes"]))
    with changing(results) as rows:
        rows[row["step"], row["mode"]] = row


def _is_whole(known: Call | None, row: Call) -> bool:
    """Whether earlier calls finished the step by the same commit."""
    if known is None:
        return False
    return known["status"] == FINISHED and known["commit"] == row["commit"]


def step_of(row: Mapping[str, Any]) -> str:
    """The step of a call as records name it: ``MODE/NAME``."""
    return f"{row['mode']}/{row['step']}"


def wall_seconds(row: Mapping[str, Any]) -> float:
    """Share of a step in the time that the whole took: two lanes ran at a time, or one."""
    return float(row["seconds"]) / float(row["lanes"])


@contextmanager
def changing(results: Path) -> Iterator[dict[tuple[str, str], Call]]:
    """The rows of reproduce.csv by step and mode, which are written back at the end. Another
    process, or another lane of this one, waits until then."""
    with locks.held(store.lock_of(results, FILE), timeout_s=-1):
        rows = read(results)
        yield rows
        write(results, rows.values())


def write(results: Path, rows: Iterable[Call]) -> None:
    """Write reproduce.csv, if there are any rows."""
    if table := list(rows):
        text = pd.DataFrame(table).to_csv(index=False, lineterminator="\n")
        write_atomically(results / FILE, text)


def read(results: Path) -> dict[tuple[str, str], Call]:
    """Rows of reproduce.csv by step and mode."""
    path = results / FILE
    if not path.is_file():
        return {}
    rows = pd.read_csv(path).to_dict("records")
    return {(row["step"], row["mode"]): row for row in rows}
