"""Tables that people write: a CSV with a header, as programs and spreadsheets save it.

It is UTF-8, or UTF-16 with or without a mark at its beginning. Where the header has more semicolons
or tabs than commas, these separate, and a comma in a number is the decimal one.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from hdc.readers.files import check_file

Rows = list[tuple[str, dict[str, str]]]
"""Place of each row, such as "t.csv, line 3", and its texts by column."""
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[-+]?[\d.]*,\d+(?:[eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+(?:,\d*)?")
"""A number with points between thousands; in English it may be a fraction."""


def parse_number(text: str) -> float | None:
    """A finite number as tables write one; None for other text, such as ``nan`` or ``1_0``."""
    if not _NUMBER.fullmatch(text):
        return None
    number = float(text)
    return number if math.isfinite(number) else None


def read_csv(path: Path, required: Sequence[str] = ()) -> Rows:
    """The rows of a CSV.

    Raises:
        ValueError: no such file, not a table, a column missing, a row of another length, a required
            value or a label that is empty, or a number of two readings.
    """
    check_file(path)
    try:
        with _opened(path) as (file, separator, before):
            reader = csv.reader(file, strict=True, delimiter=separator)
            header = _stripped(next(reader, []))
            lines = [
                (f"{path}, line {before + reader.line_num}", _stripped(cells))
                for cells in reader
                if cells
            ]
    except (UnicodeError, csv.Error) as error:
        raise ValueError(
            f"{path}: expected a CSV table in UTF-8 (in a spreadsheet: save as CSV UTF-8), found: "
            f"{error}"
        ) from error
    if not set(required) <= set(header) or len(set(header)) < len(header):
        wanted = ", ".join(("different columns", *required))
        raise ValueError(f"{path}: expected {wanted}, found {header}")
    if separator != ",":
        lines = _with_points(lines)
    return [(place, _row(place, header, cells, required)) for place, cells in lines]


def columns_in(path: Path) -> list[str]:
    """Names of the columns of a CSV; none where there is no such table."""
    try:
        with _opened(path) as (file, separator, _):
            return _stripped(next(csv.reader(file, delimiter=separator), []))
    except (OSError, UnicodeError, csv.Error):  # whoever reads it says so
        return []


@contextmanager
def _opened(path: Path) -> Iterator[tuple[IO[str], str, int]]:
    """A table before its header, its separator, and how many lines lie before the header:
    spreadsheets may state the separator in a line sep=;."""
    with path.open("rb") as file:
        start = file.read(2)
    encoding = "utf-8-sig"
    if start in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif start[1:] == b"\0":  # every second byte of plain characters is zero
        encoding = "utf-16-le"
    with path.open(encoding=encoding, newline="") as text:
        first = text.readline()
        if re.fullmatch(r"sep=.\s*", first):
            yield text, first[4], 1
        else:
            text.seek(0)
            yield text, max(",;\t", key=first.count), 0


def _stripped(cells: Sequence[str]) -> list[str]:
    return [cell.strip() for cell in cells]


def _row(
    place: str, header: list[str], cells: list[str], required: Sequence[str]
) -> dict[str, str]:
    if len(cells) != len(header):
        raise ValueError(f"{place}: expected {len(header)} values, found {len(cells)}")
    row = dict(zip(header, cells, strict=True))
    for name in (*required, "label"):
        if row.get(name) == "":
            raise ValueError(f"{place}: expected a {name}, found none")
    return row


def _with_points(lines: list[tuple[str, list[str]]]) -> list[tuple[str, list[str]]]:
    """Cells with decimal points for decimal commas.

    Raises:
        ValueError: 1.000 may be one or a thousand, for commas are decimal.
    """
    every = [(place, cell) for place, cells in lines for cell in cells]
    if any(_DECIMAL_COMMA.fullmatch(cell) for _, cell in every):
        for place, cell in every:
            if _THOUSANDS.fullmatch(cell):
                raise ValueError(
                    f"{place}: expected 1000 or 1,0, found {cell!r} (points between thousands, "
                    "where commas are decimal)"
                )
    return [(place, [*map(_with_point, cells)]) for place, cells in lines]


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell
