"""Measurements that are more than one run: rows.csv and record.json in measured/<name>-<hash>/.

A task of ``experiments.run`` (a config with ``task._target_``) computes rows and hands them to
:func:`measure`, which writes them with everything a reader wants to know of how they were made, and
does not compute again what is there already. The hash is of the config: what was measured on other
frames lies beside it.
"""

from __future__ import annotations

import csv
import functools
import hashlib
import io
import json
import resource
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console

from experiments.records import locks, sources
from experiments.records.environment import command, environment
from experiments.records.files import read_text, remove_leftovers, results_dir, write_atomically
from experiments.records.record import (
    MOST_BYTES,
    MOST_ROW_BYTES,
    SCHEMA,
    Environment,
    Index,
    Line,
    Seconds,
    Text,
    convert,
    to_csv,
    to_json,
)

Row = dict[str, Any]
_MOST_ERROR = 2000  # characters of an error that a record keeps
_WRITE_S = 5.0  # between writing the rows of a measurement that can be resumed


class Entry(msgspec.Struct, kw_only=True):
    """What record.json of a measurement holds.

    Attributes:
        name: the experiment's.
        identity: hash of config, code and device.
        config: everything that determines the rows.
        seconds, peak_bytes: what making them took.
    """

    schema: int
    name: Text
    status: Text
    identity: Text | None = None
    config: dict[str, Any] = {}
    environment: Environment
    command: Line = ""
    seconds: Seconds | None = None
    peak_bytes: Index | None = None
    error: Text | None = None
    relabelled: dict[str, Any] | None = None


@dataclass(frozen=True)
class Measured:
    """What lies in the folder of a measurement.

    Attributes:
        rows: those of rows.csv, every value a text; empty cells are left out.
        record: what record.json says.
        folder: where both lie.
        overrides: what its config has that the experiment's in ``configs/`` has not, by key.
    """

    rows: list[dict[str, str]]
    record: Entry
    folder: Path
    overrides: Mapping[str, str] = field(default_factory=dict)

    @property
    def outdated(self) -> list[str]:
        """The files of code that have changed since."""
        return sources.outdated(self.record.environment.sources)

    @property
    def of_other_frames(self) -> bool:
        """Whether its frames, or which of them test, are not those of the experiment's config."""
        return any(key.split(".")[0] in ("scene", "split", "old_split") for key in self.overrides)


def measure(
    name: str,
    config: Mapping[str, Any],
    compute: Callable[..., Iterable[Row]],
    *,
    device: str = "cpu",
    force: bool = False,
    resumed: bool = False,
    console: Console | None = None,
) -> Path:
    """Compute the rows of a measurement and write them, unless that was done before.

    Rows computed before an error or an interruption are kept, and the record says what happened;
    the next call computes all of them anew, or, where the measurement can be `resumed`, the rest.

    Args:
        name: that of the experiment.
        config: everything that determines the rows; each ``_target_`` in it says which code makes
            them, and the one at its top, which names the task itself, is no part of what it is.
        compute: makes the rows, one after another. Of a measurement that can be resumed it is
            given the list of the rows, as texts, that were made by the same code for the same
            config; it may take out some, and makes those that are wanting.
        device: where it does so.
        force: compute even if the same code did so for the same config.
        resumed: whether rows are written as they come, for `compute` to go on from.
        console: for a line at the end.

    Returns:
        Path: the folder.

    Raises:
        locks.Held: if another process is measuring the same.
    """
    console = console or Console(highlight=False)
    torch = sys.modules.get("torch")
    made = environment(device, torch.get_num_threads() if torch else 1, config)
    folder = folder_of(name, config)
    config = {key: value for key, value in config.items() if key != "_target_"}
    identity = _hash([config, made["code"], device])
    entry: Row = {
        "schema": SCHEMA,
        "name": name,
        "identity": identity,
        "command": command(),
        "config": config,
        "environment": made,
    }
    with locks.held(folder / locks.FILE, folder.name):
        remove_leftovers(folder)
        known = None if force else read(folder)
        if known and (known.record.status, known.record.identity) == ("finished", identity):
            console.print(f"{name}: finished before (force=true runs it again)")
            return folder
        begun: list[Row] = []
        if resumed:
            if known and known.record.identity == identity:
                begun = [dict(row) for row in known.rows]
                entry["seconds"] = known.record.seconds
            compute = functools.partial(compute, begun)
        n_rows = _carry_out(folder, entry, compute, begun, resumed)
    console.print(f"{name}: {n_rows} rows in {entry['seconds']:.1f} s, {folder}")
    return folder


def folder_of(name: str, config: Mapping[str, Any]) -> Path:
    """Where a measurement with this config lies, or will."""
    rest = {key: value for key, value in config.items() if key != "_target_"}
    return results_dir() / "measured" / f"{name}-{_hash(rest)}"


def _hash(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _carry_out(
    folder: Path,
    entry: Row,
    compute: Callable[[], Iterable[Row]],
    rows: list[Row],
    as_they_come: bool,
) -> int:
    """Add the rows that are computed to `rows` and write all; returns how many."""
    start = written = time.perf_counter()
    start -= entry.get("seconds") or 0.0  # of those that were there

    def write(status: str) -> None:
        entry.update(seconds=time.perf_counter() - start, peak_bytes=peak_bytes())
        # Between these two the record must not vouch for the rows.
        write_atomically(folder / "record.json", to_json(entry | {"status": "running"}))
        write_atomically(folder / "rows.csv", to_csv(rows))
        write_atomically(folder / "record.json", to_json(entry | {"status": status}))

    try:
        for row in compute():  # what came before an error stays
            rows.append(row)
            if as_they_come and time.perf_counter() > written + _WRITE_S:
                write("interrupted")  # unless it goes on
                written = time.perf_counter()
    except BaseException as error:
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()[:_MOST_ERROR]
        with suppress(OSError):  # on a full disk; what is raised is what happened first
            write("failed" if isinstance(error, Exception) else "interrupted")
        raise
    write("finished")
    return len(rows)


def in_parts(
    name: str,
    parts: Iterable[tuple[Mapping[str, Any], Callable[[], Iterable[Row]]]],
    *,
    force: bool = False,
) -> Iterator[Row]:
    """The rows of a long measurement, each part kept as soon as it is done.

    For ``compute`` of :func:`measure`: after an interruption the parts that the same code has made
    before are read from ``cache/parts`` of the results folder. Seconds of a record are those of its
    last call.

    Args:
        name: that of the experiment.
        parts: for each, the config that determines its rows, as in :func:`measure`, and what makes
            them.
        force: compute even what is kept.
    """
    for config, compute in parts:
        code = sources.code_hash(sources.sources(config))
        path = results_dir() / "cache" / "parts" / f"{name}-{_hash([config, code])}.json"
        try:
            if force:
                raise FileNotFoundError
            rows = json.loads(read_text(path, MOST_ROW_BYTES))["rows"]
        except (FileNotFoundError, ValueError, KeyError, TypeError):
            # None yet, or none that can be read: made anew.
            rows = list(compute())
            write_atomically(path, to_json({"rows": rows}))
        yield from rows


def read(folder: Path) -> Measured | None:
    """The measurement in a folder, or None where there is none.

    Raises:
        ValueError: naming the file, if it is no record.
    """
    path = folder / "record.json"
    try:
        entry = msgspec.json.decode(read_text(path, MOST_BYTES))
        if not isinstance(entry, dict) or entry.get("schema") != SCHEMA:
            raise ValueError(f"expected a record of schema {SCHEMA}, found another")
        record = convert(entry, Entry, "")
    except FileNotFoundError:
        return None
    except (ValueError, RecursionError, OSError) as error:
        raise ValueError(f"{path}: expected a record of a measurement, found: {error}") from error
    path = folder / "rows.csv"
    try:
        text = read_text(path, MOST_ROW_BYTES) if path.exists() else ""
        table = csv.DictReader(io.StringIO(text, newline=""), restkey="", strict=True)
        rows = [{k: v for k, v in row.items() if v} for row in table]
    except (ValueError, OSError, csv.Error) as error:
        raise ValueError(f"{path}: expected a CSV table in UTF-8, found: {error}") from error
    if any("" in row for row in rows):
        raise ValueError(f"{path}: expected as many values in a row as columns, found more")
    return Measured(rows, record, folder)


def peak_bytes() -> int:
    """The most memory this process has held so far."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
