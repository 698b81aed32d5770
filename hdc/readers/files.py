"""Files, settings and tables that people give; every error names them."""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"\s*[-+]?\d{1,3}(?:\.\d{3})+(,\d*)?\s*")
"""A number with points between thousands; in English it may be a fraction."""
_DECIMAL_COMMA = re.compile(r"^(\s*[-+]?\d*),(\d+(?:[eE][-+]?\d+)?\s*)$")


LIBRARIES = {
    "cv2": "readers",
    "tifffile": "readers",
    "imagecodecs": "files",
    "av": "files",
    "h5py": "files",
    "scipy": "files",
    "pyarrow": "files",
}
"""Packages that read files, and the extra of this distribution that brings each."""


def missing(package: str) -> ModuleNotFoundError:
    """The error of a package that is not installed, with the extra that brings it."""
    extra = LIBRARIES[package]
    text = f"expected the package {package}, found none; pip install 'speckle-hdc[{extra}]'"
    return ModuleNotFoundError(text, name=package)


@contextmanager
def missing_named() -> Iterator[None]:
    """A package that is missing is named in one line, with the extra that brings it."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in LIBRARIES:
            raise
        raise missing(package) from error


class BadFrame(ValueError):
    """A frame that cannot be used, and why."""


class SettingError(ValueError):
    """A setting out of range, as ``name: expected …, found …``."""


_SHOWN = 12
"""Choices that an error lists."""


class Ambiguous(ValueError):
    """Something that has several readings.

    Attributes:
        choices: the words of the command line that take each of them.
    """

    def __init__(self, where: object, choices: Sequence[str]) -> None:
        self.choices = tuple(choices)
        shown = "; or ".join(self.choices[:_SHOWN])
        rest = len(self.choices) - _SHOWN
        more = f"; or {rest} more" if rest > 0 else ""
        super().__init__(f"{where}: expected one of {shown}{more}")


def require(condition: bool, name: str, found: object, expected: str) -> None:
    """Raise a :class:`SettingError` unless the condition holds."""
    if not condition:
        raise SettingError(f"{name}: expected {expected}, found {found!r}")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    key: list[tuple[int, int, str]] = []
    for part in re.split(r"([0-9]+)", name):
        if part.isdecimal():
            key.append((0, int(part), part))
        elif part:
            key.append((1, 0, part.casefold()))
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def parse_number(text: str) -> float | None:
    """A finite number as tables write one; None for other text, such as ``nan`` or ``1_0``."""
    if not _NUMBER.fullmatch(text):
        return None
    number = float(text)
    return number if math.isfinite(number) else None


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
    """Place ("FILE, line 3") and values by column of each row of a CSV with a header.

    It is UTF-8, or UTF-16 with a mark at its beginning. Where the header has more semicolons or
    tabs than commas, these separate, and a comma in a number is the decimal one.

    Raises:
        ValueError: no such file, not a table, a column missing, a row of another length, or a
            required value or a label that is empty.
    """
    check_file(path)
    try:
        with path.open(encoding=_encoding(path), newline="") as file:
            separator = _start(file)
            reader = csv.reader(file, strict=True, delimiter=separator)
            header = [name.strip() for name in next(reader, [])]
            _check_header(path, header, required)
            plain = separator == ","
            commas = _Commas()
            for cells in reader:
                where = f"{path}, line {reader.line_num}"
                cells = cells if plain else commas.as_points(where, cells)
                if cells:
                    yield where, _row(where, header, cells, required)
    except (UnicodeError, csv.Error) as error:
        raise ValueError(
            f"{path}: expected a CSV table in UTF-8 (in a spreadsheet: save as CSV UTF-8), found: "
            f"{error}"
        ) from error


class _Commas:
    """Numbers of a table whose cells other signs separate than commas."""

    def __init__(self) -> None:
        self._decimal = False
        self._thousands = ""

    def as_points(self, where: str, cells: list[str]) -> list[str]:
        """Cells with decimal points for decimal commas.

        Raises:
            ValueError: 1.000 may be one or a thousand, for commas are decimal.
        """
        for cell in cells:
            thousands = _THOUSANDS.fullmatch(cell)
            if thousands and not self._thousands:
                self._thousands = f"{where}: expected 1000 or 1,0, found {cell!r}"
            self._decimal |= "," in cell and bool(
                thousands or _DECIMAL_COMMA.fullmatch(cell)
            )
        if self._thousands and self._decimal:
            raise ValueError(
                f"{self._thousands} (points between thousands, where commas are decimal)"
            )
        return [_DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in cells]


def _start(file: IO[str]) -> str:
    """The separator of a table, before its header; spreadsheets may state it in a line sep=;."""
    first = file.readline()
    if not re.fullmatch("sep=.\\s*", first):
        file.seek(0)
        return _separator(first)
    return first[4]


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(4)
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    # Without a mark, every second byte of plain characters is zero.
    return {b"\0": "utf-16-le"}.get(start[1:2], "utf-8-sig")


def columns_in(path: Path) -> list[str]:
    """Names of the columns of a CSV; none where there is no such file."""
    if not path.is_file():
        return []
    with path.open(encoding=_encoding(path), errors="replace", newline="") as file:
        separator = _start(file)
        first = file.readline()
    try:
        header = next(csv.reader([first], delimiter=separator), [])
    except csv.Error:  # no table; whoever reads it says so
        return []
    return [name.strip() for name in header]


def _separator(header: str) -> str:
    return max(",;\t", key=header.count)


def _check_header(path: Path, header: list[str], required: Sequence[str]) -> None:
    if set(required) <= set(header) and len(set(header)) == len(header):
        return
    wanted = "different columns"
    if required:
        wanted += f", with {', '.join(required)}"
    raise ValueError(f"{path}: expected {wanted}, found {header}")


def _row(
    where: str, header: list[str], cells: list[str], required: Sequence[str]
) -> dict[str, str]:
    if len(cells) != len(header):
        raise ValueError(f"{where}: expected {len(header)} values, found {len(cells)}")
    row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
    for name in (*required, "label"):
        if row.get(name) == "":
            raise ValueError(f"{where}: expected a {name}, found none")
    return row
