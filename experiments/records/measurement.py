"""Measurements: the typed rows of an experiment, in ``measured/<name>-<hash>/``.

``rows.jsonl`` has one row per line (``pandas.read_json(path, lines=True)``), ``record.json`` says
how they were made. The hash is that of the config, so that what was measured on other frames
lies beside it.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import msgspec
import pandas as pd
from rich.console import Console

from experiments.records import locks, sources
from experiments.records.environment import command, environment
from experiments.records.files import results_dir
from experiments.records.record import SCHEMA, Environment, plain
from hdc.io import write_atomically

Row = dict[str, Any]
"""Values of a row by column: int, float, str, bool, None, or a short list of numbers."""


class Entry(msgspec.Struct, kw_only=True):
    """Content of record.json.

    Attributes:
        name: the experiment's.
        identity: hash of config, code and device.
        config, scene: as :func:`measure` has them.
        seconds: of the call that made the rows.
    """

    schema: Literal[3]
    name: str
    status: str
    identity: str
    config: dict[str, Any]
    environment: Environment
    scene: str = ""
    command: str = ""
    seconds: float | None = None


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
        return sources.outdated(self.record.environment.sources, self.record.config)

    @property
    def of_other_frames(self) -> bool:
        """Whether its frames, or which of them test, are not those of the experiment's config."""
        return any(
            key.split(".")[0] in ("scene", "split", "old_split")
            for key in self.overrides
        )


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
        Path: the folder; :class:`locks.Held` is raised while another process measures the same.
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
        known = None if force else read(folder)
        wanted = "finished", entry["identity"]
        if known and (known.record.status, known.record.identity) == wanted:
            console.print(f"{name}: finished before (force=true runs it again)")
            return folder
        start = time.perf_counter()
        rows = list(compute())
        entry |= {"status": "finished", "seconds": time.perf_counter() - start}
        write(folder, entry, rows)
    console.print(f"{name}: {len(rows)} rows in {entry['seconds']:.1f} s, {folder}")
    return folder


def digest_of(value: Any) -> str:
    """12 hexadecimal digits that tell JSON values apart."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def write(folder: Path, entry: Mapping[str, Any], rows: Iterable[Row]) -> None:
    """Write rows.jsonl and record.json, one line per key; a crash in between leaves no record that
    vouches for rows of another call."""
    lines = (
        f"{json.dumps(key)}: {msgspec.json.encode(value, enc_hook=plain).decode()}"
        for key, value in sorted(entry.items())
    )
    (folder / "record.json").unlink(missing_ok=True)
    write_atomically(folder / "rows.jsonl", to_lines(rows))
    write_atomically(folder / "record.json", "{\n" + ",\n".join(lines) + "\n}\n")


def to_lines(rows: Iterable[Row]) -> str:
    """Rows as JSON lines; numbers that JSON lacks (NaN, infinities) become null."""
    return "".join(
        f"{msgspec.json.encode(row, enc_hook=plain).decode()}\n" for row in rows
    )


def from_lines(text: str) -> list[Row]:
    """The rows in a text of JSON lines."""
    return [msgspec.json.decode(line) for line in text.splitlines()]


def part(
    name: str, config: Mapping[str, Any], compute: Callable[[], Iterable[Row]]
) -> list[Row]:
    """The rows of a part of a long :func:`measure`, kept in ``cache/parts`` once complete."""
    code = sources.code_hash(sources.sources(config))
    path = (
        results_dir() / "cache" / "parts" / f"{name}-{digest_of([config, code])}.jsonl"
    )
    with suppress(FileNotFoundError, ValueError):
        return from_lines(path.read_text(encoding="utf-8"))
    rows = list(compute())
    write_atomically(path, to_lines(rows))
    return rows


def read(folder: Path) -> Measured | None:
    """The measurement in a folder, None where there is none; a ValueError names a bad file."""
    path = folder / "record.json"
    if not path.exists():
        return None
    try:
        record = msgspec.json.decode(path.read_bytes(), type=Entry, strict=False)
        path = folder / "rows.jsonl"
        rows = from_lines(path.read_text(encoding="utf-8")) if path.exists() else []
        return Measured(rows, record, folder)
    except (ValueError, OSError) as error:
        raise ValueError(
            f"{path}: expected a record of a measurement, found: {error}"
        ) from error
