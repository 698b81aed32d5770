"""Reading files that may be broken or hostile: bounded, regular, and named in every error."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

MOST_TABLE_BYTES = 2**23
"""Of a table: some 100,000 rows, which take some 100 times as many bytes as Python objects."""
MOST_LETTERS = 200
"""Of a label; an archive may hold one of a gigabyte."""


class BadFrame(ValueError):
    """A frame that cannot be used, and why; ``on_bad_frame`` decides what happens."""


def shown(name: object) -> str:
    """A name from outside, fit for a message or a record: control characters are escaped."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(name)
    )


def label(text: str, where: str) -> str:
    """The name of a class as it is shown and recorded.

    Raises:
        ValueError: it is empty, holds control characters (two names could look alike), or is longer
            than a name would be.
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
    """Sorts frame2 before frame10, and the same everywhere: no locale is asked."""
    parts = re.split(r"([0-9]+)", name)
    key = tuple((0, int(p), p) if p.isdecimal() else (1, 0, p.casefold()) for p in parts if p)
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def file_size(path: Path) -> int:
    """Bytes of a regular file; to open a pipe or a device would wait for ever.

    Raises:
        BadFrame: it is no regular file (a folder, a pipe, a loop of links), or there is none.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise BadFrame(_unreadable(path, error)) from error
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
        raise BadFrame(f"{shown(path)}: expected a file, found {kind}")
    return status.st_size


def open_file(path: Path, limit: int, what: str = "an image") -> BinaryIO:
    """A regular file of at most ``limit`` bytes, opened; ``what`` it should be.

    Raises:
        BadFrame: it is none (:func:`file_size`), is empty, larger or unreadable.
    """
    if (size := file_size(path)) > limit:
        raise BadFrame(f"{shown(path)}: expected at most {limit} bytes, found {size}")
    if not size:
        raise BadFrame(f"{shown(path)}: expected {what}, found an empty file")
    try:
        return path.open("rb")
    except OSError as error:
        raise BadFrame(_unreadable(path, error)) from error


def _unreadable(path: Path, error: OSError | ValueError) -> str:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{shown(path)}: expected a readable file, found: {reason}"


def file_digest(path: Path) -> str:
    """SHA-256 of the contents."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_csv(path: Path, required: tuple[str, ...]) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows of a comma-separated table in UTF-8 whose header holds at least the given columns.

    Yields:
        For each row, where it is ("FILE, line 3", as an editor counts) and its values by column.

    Raises:
        ValueError: no such file, not a table, too large, a column missing, or a row of another
            length.
    """
    what = f"a CSV table in UTF-8 with columns {', '.join(required)}"
    try:
        with open_file(path, MOST_TABLE_BYTES, what) as file:
            text = file.read().decode("utf-8-sig")
        yield from _rows(path, csv.reader(io.StringIO(text, newline=""), strict=True), required)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{shown(path)}: expected {what}, found: {error}") from error
    except BadFrame as error:
        if isinstance(cause := error.__cause__, OSError):
            error = BadFrame(f"{shown(path)}: expected {what}, found: {cause.strerror}")
        raise ValueError(str(error)) from error


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
    line, some = reader.line_num + 1, False  # of the next row, which may have line breaks in quotes
    for row in reader:
        where, line = f"{shown(path)}, line {line}", reader.line_num + 1
        if not row:  # a blank line
            continue
        if len(row) != len(header):
            raise ValueError(f"{where}: expected {len(header)} values, found {len(row)}")
        yield where, dict(zip(header, (value.strip() for value in row), strict=True))
        some = True
    if not some:
        raise ValueError(f"{shown(path)}: expected at least one row, found none")


def usable_cores() -> int:
    """Cores that this process may use; fewer than the machine has under taskset or in a job."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    affinity = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    return len(affinity(0)) if affinity else os.cpu_count() or 1
