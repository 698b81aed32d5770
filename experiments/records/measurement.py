"""Measurements: the typed rows of an experiment, in ``measured/<name>-<hash>/``.

``rows.jsonl`` has a row a line (``pandas.read_json(path, lines=True)`` reads it), ``record.json``
says how they were made. The hash is that of the config, so that what was measured on other frames
lies beside it.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd
from rich.console import Console

from experiments.records import locks, sources
from experiments.records.environment import command, environment
from experiments.records.files import remove_leftovers, results_dir
from experiments.records.record import SCHEMA, Environment, convert, plain
from hdc.io import write_atomically

Row = dict[str, Any]
"""Values of a row by column: int, float, str, bool, None, or a short list of numbers."""

_ERROR_CHARACTERS = 2000


class Entry(msgspec.Struct, kw_only=True):
    """Content of record.json.

    Attributes:
        name: the experiment's.
        identity: hash of config, code and device.
        config: everything that determines the rows.
        scene: name of the scene's config, where it has one.
        seconds: of the call that made the rows.
        proven: how later code was shown to compute the same (experiments.reference --prove).
    """

    schema: int
    name: str
    status: str
    identity: str
    config: dict[str, Any]
    environment: Environment
    scene: str = ""
    command: str = ""
    seconds: float | None = None
    error: str | None = None
    proven: dict[str, Any] | None = None


@dataclass(frozen=True)
class Measured:
    """A measurement.

    Attributes:
        rows: typed, in the order in which they were made.
        record: content of record.json.
        folder: where both lie.
        overrides: values of its config that differ from the experiment's in ``configs/``, by key.
    """

    rows: list[Row]
    record: Entry
    folder: Path
    overrides: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The rows as a data frame; a missing number is NaN, other missing values are None."""
        return pd.DataFrame(self.rows)

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
    compute: Callable[[], Iterable[Row]],
    *,
    scene: str = "",
    device: str = "cpu",
    force: bool = False,
    console: Console | None = None,
) -> Path:
    """Write the rows of a measurement, unless the same code did for the same config.

    Args:
        name: that of the experiment.
        config: everything that determines the rows; each ``_target_`` in it names code.
        compute: makes the rows.
        scene: name of the scene's config, where it has one.
        device: as torch names it.
        force: compute again.
        console: for a line at the end.

    Returns:
        Path: the folder.

    Raises:
        locks.Held: if another process is measuring the same.
    """
    console = console or Console(highlight=False)
    torch = sys.modules.get("torch")
    made_by = environment(device, torch.get_num_threads() if torch else 1, config)
    config = {key: value for key, value in config.items() if key != "_target_"}
    folder = results_dir() / "measured" / f"{name}-{digest_of(config)}"
    entry: Row = {
        "schema": SCHEMA,
        "name": name,
        "scene": scene,
        "identity": digest_of([config, made_by["code"], device]),
        "command": command(),
        "config": config,
        "environment": made_by,
    }
    with locks.held(folder / locks.FILE, folder.name):
        remove_leftovers(folder)
        known = None if force else read(folder)
        wanted = "finished", entry["identity"]
        if known and (known.record.status, known.record.identity) == wanted:
            console.print(f"{name}: finished before (force=true runs it again)")
            return folder
        rows = _carry_out(folder, entry, compute)
    console.print(f"{name}: {len(rows)} rows in {entry['seconds']:.1f} s, {folder}")
    return folder


def digest_of(value: Any) -> str:
    """12 hexadecimal digits that tell JSON values apart."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _carry_out(folder: Path, entry: Row, compute: Callable[[], Iterable[Row]]) -> list[Row]:
    """Compute the rows and write them; a measurement that fails leaves a finished one as it was."""
    rows: list[Row] = []
    start = time.perf_counter()
    try:
        rows.extend(compute())
        status = "finished"
    except BaseException as error:
        status = "failed" if isinstance(error, Exception) else "interrupted"
        text = "".join(traceback.format_exception_only(error)).strip()[:_ERROR_CHARACTERS]
        if not (folder / "record.json").exists():  # a full disk must not hide the first error
            with suppress(OSError):
                write(folder, entry | {"status": status, "error": text}, [])
        raise
    entry |= {"status": status, "seconds": time.perf_counter() - start}
    write(folder, entry, rows)
    return rows


def write(folder: Path, entry: Mapping[str, Any], rows: Iterable[Row]) -> None:
    """Write rows.jsonl and record.json; a crash in between leaves no record that vouches for rows
    of another call."""
    write_atomically(folder / "record.json", _to_json({**entry, "status": "running"}))
    write_atomically(folder / "rows.jsonl", to_lines(rows))
    write_atomically(folder / "record.json", _to_json(entry))


def _to_json(entry: Mapping[str, Any]) -> str:
    """An entry of plain values, a line a key; numbers that JSON lacks become null."""
    lines = (
        f"{json.dumps(key)}: {msgspec.json.encode(value, enc_hook=plain).decode()}"
        for key, value in sorted(entry.items())
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"


def to_lines(rows: Iterable[Row]) -> str:
    """Rows as JSON lines; numbers that JSON lacks (NaN, infinities) become null."""
    return "".join(f"{msgspec.json.encode(row, enc_hook=plain).decode()}\n" for row in rows)


def from_lines(text: str) -> list[Row]:
    """The rows in a text of JSON lines."""
    return [msgspec.json.decode(line) for line in text.splitlines()]


def part(name: str, config: Mapping[str, Any], compute: Callable[[], Iterable[Row]]) -> list[Row]:
    """The rows of a part of a long measurement, kept in ``cache/parts`` once they are complete.

    Arguments are those of :func:`measure`.
    """
    code = sources.code_hash(sources.sources(config))
    path = results_dir() / "cache" / "parts" / f"{name}-{digest_of([config, code])}.jsonl"
    with suppress(FileNotFoundError, ValueError):
        return from_lines(path.read_text(encoding="utf-8"))
    rows = list(compute())
    write_atomically(path, to_lines(rows))
    return rows


def read(folder: Path) -> Measured | None:
    """The measurement in a folder, or None where there is none.

    Raises:
        ValueError: naming the file, if it is no record.
    """
    path = folder / "record.json"
    if not path.exists():
        return None
    try:
        record = convert(msgspec.json.decode(path.read_bytes()), Entry)
        if record.schema != SCHEMA:
            raise ValueError(f"expected a record of schema {SCHEMA}, found {record.schema}")
        path = folder / "rows.jsonl"
        rows = from_lines(path.read_text(encoding="utf-8")) if path.exists() else []
        return Measured(rows, record, folder)
    except (ValueError, OSError) as error:
        raise ValueError(f"{path}: expected a record of a measurement, found: {error}") from error


def measurements(folder: Path) -> Iterator[Path]:
    """Folders of measurements in a results folder."""
    return (path.parent for path in sorted((folder / "measured").glob("*/record.json")))
