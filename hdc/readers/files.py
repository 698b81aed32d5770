"""Names, tables and files that people give; every error names them."""

from __future__ import annotations

import csv
import os
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


def shown(name: object) -> str:
    """A name from outside, fit for a message or a record: control characters are escaped."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(name)
    )


def label(text: str, where: str) -> str:
    """The name of a class.

    Raises:
        ValueError: it is empty, or holds control characters (two could look alike).
    """
    if not text or shown(text) != text:
        raise ValueError(f"{where}: expected a label of printable letters, found {shown(text)!r}")
    return text


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    parts = re.split(r"([0-9]+)", name)
    key = tuple((0, int(p), p) if p.isdecimal() else (1, 0, p.casefold()) for p in parts if p)
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def check_file(path: Path) -> None:
    """Raise a :class:`BadFrame` unless there is a regular file: to open a pipe may never end."""
    try:
        path.stat()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadFrame(f"{shown(path)}: expected a readable file, found: {reason}") from error
    if not path.is_file():
        raise BadFrame(f"{shown(path)}: expected a regular file, found a folder, pipe or device")


def check_memory(nbytes: int, where: object, remedy: str) -> None:
    """Raise a ValueError for what takes more than half of the machine's memory."""
    most = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    if nbytes > most:
        raise ValueError(
            f"{shown(where)}: expected at most {most} bytes, half of the memory, found {nbytes} or "
            f"more; {remedy}"
        )


def read_csv(path: Path, required: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows of a comma-separated table in UTF-8 with a header.

    Yields:
        For each row, its place ("FILE, line 3") and its values by column.

    Raises:
        ValueError: no such file, not a table, a column missing, or a row of another length.
    """
    columns, empty = ", ".join(required), True
    try:
        check_file(path)
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if not set(required) <= set(header) or len(set(header)) < len(header):
                raise ValueError(
                    f"{shown(path)}: expected different columns, with {columns}, "
                    f"found {shown(header)[:200]}"
                )
            for row in filter(None, reader):
                where, empty = f"{shown(path)}, line {reader.line_num}", False
                if len(row) != len(header):
                    raise ValueError(f"{where}: expected {len(header)} values, found {len(row)}")
                yield where, dict(zip(header, (value.strip() for value in row), strict=True))
    except (UnicodeDecodeError, csv.Error, OSError, BadFrame) as error:
        raise ValueError(
            f"{shown(path)}: expected a CSV table in UTF-8 with columns {columns}, found: "
            f"{str(error).rpartition('found: ')[2]}"
        ) from error
    if empty:
        raise ValueError(f"{shown(path)}: expected at least one row, found none")
