"""Names, tables and files that people give: read with care, and named in every error."""

from __future__ import annotations

import csv
import io
import os
import re
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MOST_TABLE_BYTES = 2**26
MOST_LETTERS = 200
"""Length of a label."""


class BadFrame(ValueError):
    """A frame that cannot be used, and why; ``on_bad_frame`` decides what happens."""


class SettingError(ValueError):
    """A setting out of range, as ``name: expected …, found …``."""


def require(condition: bool, name: str, found: Any, expected: str) -> None:
    """Raise a :class:`SettingError` unless the condition holds."""
    if not condition:
        raise SettingError(f"{name}: expected {expected}, found {found!r}")


def shown(name: object) -> str:
    """A name from outside, fit for a message or a record: control characters are escaped."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(name)
    )


def label(text: str, where: str) -> str:
    """Check the name of a class.

    Raises:
        ValueError: it is empty, too long, or holds control characters (two could look alike).
    """
    if not text:
        raise ValueError(f"{where}: expected a label, found none")
    if len(text) > MOST_LETTERS:
        raise ValueError(
            f"{where}: expected a label of at most {MOST_LETTERS} letters, found {len(text)}"
        )
    if shown(text) != text:
        raise ValueError(f"{where}: expected a label of printable letters, found {shown(text)!r}")
    return text


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    parts = re.split(r"([0-9]+)", name)
    key = tuple((0, int(p), p) if p.isdecimal() else (1, 0, p.casefold()) for p in parts if p)
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def file_size(path: Path) -> int:
    """Bytes of a regular file.

    Raises:
        BadFrame: there is no such file, or it is a folder, a pipe or a device.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BadFrame(f"{shown(path)}: expected a readable file, found: {reason}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
        raise BadFrame(f"{shown(path)}: expected a file, found {kind}")
    return status.st_size


def read_csv(path: Path, required: tuple[str, ...]) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows of a comma-separated table in UTF-8 with a header.

    Yields:
        For each row, its place ("FILE, line 3", as an editor counts) and its values by column.

    Raises:
        ValueError: no such file, not a table, a column missing, or a row of another length.
    """
    what = f"a CSV table in UTF-8 with columns {', '.join(required)}"
    try:
        if not 0 < (size := file_size(path)) <= MOST_TABLE_BYTES:
            raise ValueError(f"{shown(path)}: expected {what}, found {size} bytes")
        text = path.read_bytes().decode("utf-8-sig")
        yield from _rows(path, csv.reader(io.StringIO(text, newline=""), strict=True), required)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{shown(path)}: expected {what}, found: {error}") from error
    except OSError as error:
        raise ValueError(f"{shown(path)}: expected {what}, found: {error.strerror}") from error
    except BadFrame as error:
        raise ValueError(str(error).replace("a readable file", what)) from error


def _rows(
    path: Path, reader: Any, required: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, str]]]:
    header = [name.strip() for name in next(reader, [])]
    found = shown(header)[:MOST_LETTERS]
    if missing := [name for name in required if name not in header]:
        raise ValueError(
            f"{shown(path)}: expected columns {', '.join(required)}, "
            f"found no {', '.join(missing)} in {found}"
        )
    if len(set(header)) < len(header):
        raise ValueError(f"{shown(path)}: expected different column names, found {found}")
    line, empty = reader.line_num + 1, True  # a row may have line breaks in quotes
    for row in reader:
        where, line = f"{shown(path)}, line {line}", reader.line_num + 1
        if not row:  # a blank line
            continue
        if len(row) != len(header):
            raise ValueError(f"{where}: expected {len(header)} values, found {len(row)}")
        yield where, dict(zip(header, (value.strip() for value in row), strict=True))
        empty = False
    if empty:
        raise ValueError(f"{shown(path)}: expected at least one row, found none")


def usable_cores() -> int:
    """Cores that this process may use; fewer than the machine has under taskset or in a job."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    affinity = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    return len(affinity(0)) if affinity else os.cpu_count() or 1
