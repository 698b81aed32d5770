"""Measurements that are more than one run: rows.csv and record.json in results/measured/<name>/.

A task of ``experiments.run`` (a config with ``task._target_``) computes rows and hands them to
:func:`measure`, which writes them with everything a reader wants to know of how they were made, and
does not compute again what is there already.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import resource
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from experiments import locks, record, sources

Row = dict[str, Any]


@dataclass(frozen=True)
class Measured:
    """What lies in the folder of a measurement.

    Attributes:
        rows: of rows.csv, every value a text; empty cells are left out.
        record: of record.json: name, status, command, config, environment, seconds, peak_bytes.
    """

    rows: list[dict[str, str]]
    record: dict[str, Any]

    @property
    def outdated(self) -> list[str]:
        """The files of code that have changed since."""
        return sources.outdated(self.record["environment"]["sources"])


def measure(
    name: str,
    config: Mapping[str, Any],
    compute: Callable[[], Iterable[Row]],
    *,
    device: str = "cpu",
    force: bool = False,
    console: Console | None = None,
) -> Path:
    """Compute the rows of a measurement and write them, unless that was done before.

    Rows computed before an error or an interruption are kept, and the record says what happened;
    the next call computes all of them anew.

    Args:
        name: of the folder.
        config: everything that determines the rows; each ``_target_`` in it, and the one at its
            top that names the task itself, says which code makes them.
        compute: makes the rows, one after another.
        device: on which it does so.
        force: compute even if the same code did so for the same config.
        console: for a line at the end.

    Returns:
        Path: the folder.

    Raises:
        locks.Held: if another process is measuring the same.
    """
    console = console or Console(highlight=False)
    folder = record.results_dir() / "measured" / name
    environment = record.environment(device, torch.get_num_threads(), config)
    payload = json.dumps([config, environment["code"], device], sort_keys=True, default=str)
    identity = hashlib.sha256(payload.encode()).hexdigest()[:12]
    entry: Row = {
        "schema": record.SCHEMA,
        "name": name,
        "identity": identity,
        "command": record.command(),
        "config": dict(config),
        "environment": environment,
    }
    with locks.held(folder / locks.FILE, f"measured/{name}"):
        record.remove_leftovers(folder)
        known = read(record.results_dir(), name)
        found = known and (known.record["status"], known.record["identity"])
        if found == ("finished", identity) and not force:
            console.print(f"{name}: finished before (force=true runs it again)")
            return folder
        n_rows = _carry_out(folder, entry, compute)
    console.print(f"{name}: {n_rows} rows in {entry['seconds']:.1f} s, {folder}")
    return folder


def _carry_out(folder: Path, entry: Row, compute: Callable[[], Iterable[Row]]) -> int:
    """Compute the rows and write them; returns how many."""
    rows: list[Row] = []
    start = time.perf_counter()

    def write(status: str) -> None:
        entry.update(seconds=time.perf_counter() - start, peak_bytes=peak_bytes())
        # Between these two the record must not vouch for the rows.
        record.write_record(folder, entry | {"status": "running"})
        record.write_atomically(folder / "rows.csv", to_csv(rows))
        record.write_record(folder, entry | {"status": status})

    try:
        rows.extend(compute())  # one by one: what came before an error stays
    except BaseException as error:
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()
        with suppress(OSError):  # on a full disk; what is raised is what happened first
            write("failed" if isinstance(error, Exception) else "interrupted")
        raise
    write("finished")
    return len(rows)


def read(results: Path, name: str) -> Measured | None:
    """A measurement, or None where there is none.

    Raises:
        ValueError: naming the file, if it is no record.
    """
    folder = results / "measured" / name
    entry = record.read_record(folder)
    if entry is None:
        return None
    environment = entry.get("environment")
    if not isinstance(environment, dict) or not isinstance(environment.get("sources"), dict):
        path = folder / "record.json"
        raise ValueError(f"{path}: expected environment.sources of a measurement, found none")
    path = folder / "rows.csv"
    try:
        text = record.read_text(path, record.MOST_ROW_BYTES) if path.exists() else ""
        table = csv.DictReader(io.StringIO(text, newline=""), restkey="", strict=True)
        rows = [{k: v for k, v in row.items() if v} for row in table]
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: expected a CSV table in UTF-8, found: {error}") from error
    if any("" in row for row in rows):
        raise ValueError(f"{path}: expected as many values in a row as columns, found more")
    return Measured(rows, {"identity": None, **entry})


def to_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, a column for every key in the order of their first appearance."""
    text = io.StringIO()
    columns = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, columns, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def peak_bytes() -> int:
    """The most memory this process has held so far."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
