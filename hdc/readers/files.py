"""Files, settings and tables that people give; every error names them."""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path


class BadFrame(ValueError):
    """A frame that cannot be used, and why."""


class SettingError(ValueError):
    """A setting out of range, as ``name: expected …, found …``."""


def require(condition: bool, name: str, found: object, expected: str) -> None:
    """Raise a :class:`SettingError` unless the condition holds."""
    if not condition:
        raise SettingError(f"{name}: expected {expected}, found {found!r}")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    parts = re.split(r"([0-9]+)", name)
    key = tuple(
        (0, int(p), p) if p.isdecimal() else (1, 0, p.casefold()) for p in parts if p
    )
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def check_file(path: Path) -> None:
    """Raise a :class:`BadFrame` unless there is a regular file."""
    if not path.is_file():
        raise BadFrame(f"{path}: expected a readable file, found none")


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_csv(
    path: Path, required: Sequence[str]
) -> Iterator[tuple[str, dict[str, str]]]:
    """Place ("FILE, line 3") and values by column of each row of a CSV in UTF-8 with a header.

    Raises:
        ValueError: no such file, not a table, a column missing, a row of another length, or a
            required value or a label that is empty.
    """
    check_file(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if not set(required) <= set(header) or len(set(header)) < len(header):
                columns = ", ".join(required)
                raise ValueError(
                    f"{path}: expected different columns, with {columns}, found {header}"
                )
            for cells in filter(None, reader):
                where = f"{path}, line {reader.line_num}"
                if len(cells) != len(header):
                    raise ValueError(
                        f"{where}: expected {len(header)} values, found {len(cells)}"
                    )
                row = dict(zip(header, (cell.strip() for cell in cells), strict=True))
                for name in (*required, "label"):
                    if row.get(name) == "":
                        raise ValueError(f"{where}: expected a {name}, found none")
                yield where, row
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(
            f"{path}: expected a CSV table in UTF-8, found: {error}"
        ) from error
