"""Measurements: the typed rows of an experiment, in ``measured/<name>-<hash>/``.

``rows.jsonl`` has one row per line (``pandas.read_json(path, lines=True)``), ``record.json`` says
how they were made. The hash is that of config and data, so that what was measured on other frames
lies beside it. Parts of a long measurement are kept like it, in ``cache/parts/``.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd
from rich.console import Console

from experiments.records import locks, steps
from experiments.records.entry import SCHEMA, Entry, name_of
from experiments.records.environment import changes, command, environment
from experiments.records.files import results_dir
from experiments.records.revision import revisions
from experiments.records.rows import Row, from_lines, plain, to_lines
from hdc.io import write_atomically

# Arguments that say which frames there are.
_OF_FRAMES = ("scene", "split", "old_split")


class Measurement(Entry, kw_only=True):
    """Content of record.json.

    Attributes:
        name: the experiment's.
        task: dotted name of what makes the rows of the config.
        scene: name of the scene's config, where it has one.
        seconds: of the call that made the rows.
    """

    name: str
    task: str = ""
    scene: str = ""
    seconds: float | None = None

    @property
    def full_config(self) -> dict[str, Any]:
        return {"_target_": self.task, **self.config}


@dataclass(frozen=True)
class Measured:
    """A measurement.

    Attributes:
        rows: typed, in the order in which they were made.
        record: content of record.json.
        folder: where both lie.
    """

    rows: list[Row]
    record: Measurement
    folder: Path

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The rows as a data frame; a missing number is NaN, other missing values are None."""
        return pd.DataFrame(self.rows)

    @property
    def overrides(self) -> Mapping[str, str]:
        """Values of its config that differ from the experiment's in ``configs/``, by key."""
        return self.record.changed

    @property
    def outdated(self) -> list[str]:
        """What has another revision today."""
        return self.record.outdated

    @property
    def of_other_frames(self) -> bool:
        """Whether its frames, or which of them test, are not those of the experiment's config."""
        return any(key.partition(".")[0] in _OF_FRAMES for key in self.overrides)


def measure(
    name: str,
    config: Mapping[str, Any],
    compute: Callable[[], Iterable[Row]],
    *,
    scene: str = "",
    data: str = "",
    changed: Mapping[str, str] | None = None,
    device: str = "cpu",
    force: bool = False,
    console: Console | None = None,
) -> Path:
    """Write the rows of a measurement, unless the same revisions did for the same config and data.

    Args:
        name: that of the experiment.
        config: everything that determines the rows; each ``_target_`` in it names code.
        compute: makes the rows.
        scene: name of the scene's config, where it has one.
        data: digest of its frames, where the config does not determine them.
        changed: values that differ from those of the experiment's file, by key.
        device: as torch names it.
        force: compute again.
        console: for a line at the end.

    Returns:
        Path: the folder; :class:`locks.Held` is raised while another process measures the same.
    """
    console = console or Console(highlight=False)
    torch = sys.modules.get("torch")
    task = str(config.get("_target_", ""))
    kept = {key: value for key, value in config.items() if key != "_target_"}
    determining = dict(kept)
    if device != "cpu":
        determining["device"] = device
    identity = name_of(name, determining, data)
    folder = results_dir() / "measured" / identity
    steps.add(identity)
    with locks.held(folder / locks.FILE, folder.name):
        known = None if force else read(folder)
        if known is not None and known.record.status == "finished":
            reasons = known.outdated
            if not reasons:
                console.print(_found(name, known), soft_wrap=True, markup=False)
                return folder
            again = f"{name}: measured again: {', '.join(reasons)}"
            console.print(again, soft_wrap=True, markup=False)
        start = time.perf_counter()
        rows = list(compute())
        entry: Row = {
            "schema": SCHEMA,
            "id": identity,
            "name": name,
            "status": "finished",
            "task": task,
            "scene": scene,
            "config": kept,
            "data": data,
            "revisions": revisions(config),
            "changed": dict(changed or {}),
            "command": command(),
            "environment": environment(device, torch.get_num_threads() if torch else 1),
            "seconds": time.perf_counter() - start,
        }
        write(folder, entry, rows)
    console.print(f"{name}: {len(rows)} rows in {entry['seconds']:.1f} s, {folder}")
    return folder


def _found(name: str, known: Measured) -> str:
    text = f"{name}: finished before (force=true runs it again)"
    versions = known.record.environment.other_versions
    if versions:
        text += f", by {', '.join(versions)}"
    return text


def write(
    folder: Path,
    entry: Mapping[str, Any],
    rows: Iterable[Row],
) -> None:
    """Write rows.jsonl and record.json, one line per key; a crash in between leaves no record that
    vouches for rows of another call."""
    lines = []
    for key, value in sorted(entry.items()):
        text = msgspec.json.encode(value, enc_hook=plain).decode()
        lines.append(f"{json.dumps(key)}: {text}")
    (folder / "record.json").unlink(missing_ok=True)
    write_atomically(folder / "rows.jsonl", to_lines(rows))
    write_atomically(folder / "record.json", "{\n" + ",\n".join(lines) + "\n}\n")


def part(
    name: str,
    config: Mapping[str, Any],
    compute: Callable[[], Iterable[Row]],
    data: str = "",
) -> list[Row]:
    """The rows of a part of a long :func:`measure`, kept in ``cache/parts`` once complete."""
    of_code = [revisions(config), changes()]
    identity = name_of(name, {"config": config, "code": of_code}, data)
    path = results_dir() / "cache" / "parts" / f"{identity}.jsonl"
    try:
        return from_lines(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):  # not there, or damaged
        rows = list(compute())
        write_atomically(path, to_lines(rows))
        return rows


def read(folder: Path) -> Measured | None:
    """The measurement in a folder, None where there is none; a ValueError names a bad file."""
    path = folder / "record.json"
    if not path.exists():
        return None
    try:
        record = msgspec.json.decode(path.read_bytes(), type=Measurement, strict=False)
        path = folder / "rows.jsonl"
        rows = from_lines(path.read_text(encoding="utf-8")) if path.exists() else []
    except (ValueError, OSError) as error:
        raise ValueError(
            f"{path}: expected a record of a measurement, found: {error}"
        ) from error
    if not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"{path}: expected an object a line, found other values")
    return Measured(rows, record, folder)
