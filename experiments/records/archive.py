"""Many runs in two files: runs.jsonl, a line a run, and code.json with the digests of their code.

The form in which the reference is committed: plain text, of which a changed run is a changed line.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import msgspec

from experiments.records.files import write_atomically
from experiments.records.record import (
    Curve,
    Finished,
    Record,
    checked,
    checked_curve,
    read_curve,
    read_record,
)

RUNS, CODE = "runs.jsonl", "code.json"


def pack(
    runs: Path,
    folder: Path,
    chosen: Collection[str] | None = None,
    without: Collection[str] = (),
) -> int:
    """Put the finished runs of a live ``runs`` folder into an archive, beside those that it has.

    A run of the same name is replaced: an archive holds one version of each.

    Args:
        runs: a folder of ``<id>/record.json`` and ``curve.csv``.
        folder: folder of the archive.
        chosen: ids of the runs that are put in; without them every finished one.
        without: ids of those that the archive is to lose.

    Returns:
        int: how many were put in.

    Raises:
        ValueError: naming a file that is no record.
    """
    lines = {json.loads(line)["id"]: line.decode() for line in _lines(folder)}
    lines = {name: line for name, line in lines.items() if name not in without}
    code = _code(folder)
    new = 0
    for path in sorted(runs.glob("*/record.json")):
        record = read_record(path.parent)
        if not isinstance(record, Finished) or (chosen is not None and record.id not in chosen):
            continue
        entry: dict[str, Any] = msgspec.json.decode(path.read_bytes())
        curve = read_curve(path.with_name("curve.csv"))
        columns = list(dict.fromkeys(key for row in curve for key in row))
        entry["curve"] = {
            "columns": columns,
            "rows": [[_number(row.get(column)) for column in columns] for row in curve],
        }
        made = entry["environment"]
        code[made["code"]] = made.pop("sources")
        lines[record.id] = msgspec.json.encode(entry, order="sorted").decode()
        new += 1
    used = {json.loads(line)["environment"]["code"] for line in lines.values()}
    code = {name: files for name, files in code.items() if name in used}
    write_atomically(folder / CODE, json.dumps(code, indent=1, sort_keys=True) + "\n")
    write_atomically(folder / RUNS, "".join(f"{lines[name]}\n" for name in sorted(lines)))
    return new


def _number(value: float | None) -> float | str | None:
    """A value of a curve as JSON: what that has no number for, as a text."""
    return value if value is None or math.isfinite(value) else str(value)


def read(folder: Path) -> Iterator[tuple[str, Record, Curve] | tuple[str, ValueError]]:
    """Each run of an archive: its id, record and curve, or its id and what is wrong with it.

    Raises:
        ValueError: naming the file, if it is no archive at all.
    """
    try:
        code, lines = _code(folder), _lines(folder)
    except (OSError, msgspec.DecodeError) as error:
        raise ValueError(f"{folder}: expected an archive of runs, found: {error}") from error
    for number, line in enumerate(lines, 1):
        name = f"{RUNS}, line {number}"
        try:
            entry = msgspec.json.decode(line)
            name = str(entry["id"])
            made = entry["environment"]
            made["sources"] = code[made["code"]]
            table = entry.pop("curve")
            curve = checked_curve(
                dict(zip(table["columns"], row, strict=True)) for row in table["rows"]
            )
            record = checked(entry)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            yield name, ValueError(f"{type(error).__name__}: {error}")
        else:
            yield name, record, curve


def _code(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / CODE
    return msgspec.json.decode(path.read_bytes()) if path.is_file() else {}


def _lines(folder: Path) -> list[bytes]:
    path = folder / RUNS
    return path.read_bytes().splitlines() if path.is_file() else []
