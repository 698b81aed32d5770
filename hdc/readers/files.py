"""Files, settings and tables that people give; every error names them."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path


class BadFrame(ValueError):
    """A frame that cannot be used, and why; ``on_bad_frame`` decides what happens."""


class SettingError(ValueError):
    """A setting out of range, as ``name: expected …, found …``."""


def require(condition: bool, name: str, found: object, expected: str) -> None:
    """Raise a :class:`SettingError` unless the condition holds."""
    if not condition:
        raise SettingError(f"{name}: expected {expected}, found {found!r}")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    parts = re.split(r"([0-9]+)", name)
    key = tuple((0, int(p), p) if p.isdecimal() else (1, 0, p.casefold()) for p in parts if p)
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def check_file(path: Path) -> None:
    """Raise a :class:`BadFrame` unless there is a regular file: to open a pipe may never end."""
    if not path.is_file():
        found = "a folder, pipe or device" if path.exists() else "none"
        raise BadFrame(f"{path}: expected a readable file, found {found}")


def read_csv(path: Path, required: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows of a comma-separated table in UTF-8 with a header.

    Yields:
        For each row, its place ("FILE, line 3") and its values by column.

    Raises:
        ValueError: no such file, not a table, a column missing, a row of another length, or a
            required value or a label that is empty.
    """
    columns, rows = ", ".join(required), 0
    check_file(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if not set(required) <= set(header) or len(set(header)) < len(header):
                raise ValueError(
                    f"{path}: expected different columns, with {columns}, found {header}"
                )
            for cells in filter(None, reader):
                where, rows = f"{path}, line {reader.line_num}", rows + 1
                if len(cells) != len(header):
                    raise ValueError(f"{where}: expected {len(header)} values, found {len(cells)}")
                row = dict(zip(header, (cell.strip() for cell in cells), strict=True))
                for name in (*required, "label"):
                    if row.get(name) == "":
                        raise ValueError(f"{where}: expected a {name}, found none")
                yield where, row
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: expected a CSV table in UTF-8, found: {error}") from error
    if not rows:
        raise ValueError(f"{path}: expected at least one row, found none")
