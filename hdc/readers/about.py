"""What is said of frames beside their pixels: labels, values, order, sessions, groups.

Whatever a file is, its statements become :class:`Columns` of numbers or text, of which
:meth:`Columns.about` makes the typed :class:`About` of a recording.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hdc.readers.files import SettingError, natural_key, parse_number, read_csv

KNOWN = ("order", "session", "group")
"""Columns known by name, which are no numbers to learn."""
_INTEGER = re.compile(r"[-+]?\d+", re.ASCII)
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "inf", "+inf", "-inf"}
"""Texts for a missing number, in upper or lower case."""


class Asked(NamedTuple):
    """What a user asks to learn; see :func:`hdc.readers.open_recording`.

    Attributes:
        labels: name of the array or column of labels.
        table: a CSV.
        values: columns or arrays that are values; None means all numbers.
        fewest_classes: fewer are refused; with 0 neither labels nor values are needed.
    """

    labels: str | None = None
    table: Path | None = None
    values: Sequence[str] | None = ()
    fewest_classes: int = 2

    @property
    def named(self) -> Sequence[str]:
        """The values that are named."""
        return self.values or ()


@dataclass(frozen=True)
class About:
    """What is known of N frames.

    Attributes:
        samples: columns [N] by name: ``order`` (place in time), ``session`` and ``group`` where
            known, and others.
        classes: names of the L classes; label c means ``classes[c]``.
        labels: int64 [N]; None where there are only values.
        values: float64 [N, k], the numbers to learn; None where there are none.
        value_names: their k names.
        value_units: their k units; empty where none are known.
    """

    samples: Mapping[str, np.ndarray]
    classes: tuple[str, ...] = ()
    labels: np.ndarray | None = None
    values: np.ndarray | None = None
    value_names: tuple[str, ...] = ()
    value_units: tuple[str, ...] = ()


@dataclass
class Columns:
    """Columns of N rows.

    Attributes:
        where: the table or the file, for errors.
        n: N.
        place: of a row, for errors.
        columns: numbers or text [N] by name; that of labels is text.
        units: of numbers, by name.
        learnt: names that are learnt where none is named; None means all numbers.
        classes: names of the classes in their order, where it is stated.
    """

    where: object
    n: int
    place: Callable[[int], str]
    columns: dict[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    learnt: Sequence[str] | None = None
    classes: Sequence[str] | None = None

    @classmethod
    def read(cls, path: Path, required: Sequence[str] = ()) -> Columns:
        """The columns of a CSV; see :func:`hdc.readers.files.read_csv`."""
        found = list(read_csv(path, required))
        if not found:
            raise ValueError(f"{path}: expected a row per frame, found none")
        places, rows = zip(*found, strict=True)
        return cls.of(path, places, rows)

    @classmethod
    def of(
        cls, where: object, places: Sequence[str], rows: Sequence[Mapping[str, str]]
    ) -> Columns:
        """The columns of rows of text that all have the same names."""
        texts = {name: [row[name] for row in rows] for name in rows[0]}
        return cls.of_texts(where, len(rows), places.__getitem__, texts)

    @classmethod
    def of_texts(
        cls,
        where: object,
        n: int,
        place: Callable[[int], str],
        texts: Mapping[str, Sequence[str]],
    ) -> Columns:
        """Columns of text, as numbers where all cells are; labels stay text."""
        columns = {}
        for name, cells in texts.items():
            columns[name] = np.array(cells) if name == "label" else typed(cells)
        return cls(where, n, place, columns)

    def only(self, names: Sequence[str]) -> Columns:
        """Those of these columns that are there."""
        kept = {name: self.columns[name] for name in names if name in self.columns}
        return Columns(self.where, self.n, self.place, kept)

    def about(self, value_columns: Sequence[str] | None, fewest_classes: int) -> About:
        """What the columns mean.

        Args:
            value_columns: names of the columns to learn; where it is None, or where it is empty
                and there are no labels, those of :attr:`learnt`.
            fewest_classes: fewer are refused; with 0 neither labels nor values are needed.

        Raises:
            ValueError: there is nothing to learn, or a column is not as it has to be.
        """
        labels = self.columns.pop("label", None)
        samples = self.samples()
        if value_columns is None or (labels is None and not value_columns):
            value_columns = self.numeric() if self.learnt is None else self.learnt
        if labels is None and not value_columns and fewest_classes > 0:
            raise ValueError(
                f"{self.where}: expected a label of each frame, or numbers to learn, found "
                f"{', '.join(self.columns) or 'neither'}"
            )
        units = tuple(self.units.get(name, "") for name in value_columns)
        return About(
            samples,
            *self._classes(labels, samples, fewest_classes),
            values=self.values(value_columns),
            value_names=tuple(value_columns),
            value_units=units,
        )

    def _classes(
        self, labels: np.ndarray | None, samples: dict[str, np.ndarray], fewest: int
    ) -> tuple[tuple[str, ...], np.ndarray | None]:
        """Names of the classes, and the index of each label [N]."""
        if labels is None:
            return (), None
        names = normalised(labels.tolist())
        order = self._class_order(names, samples)
        return class_indices(names, self.where, fewest, order)

    def _class_order(
        self, labels: Sequence[str], samples: dict[str, np.ndarray]
    ) -> Sequence[str] | None:
        """Names of the classes as they are stated, or by a column class_index; else None."""
        indices = samples.pop("class_index", None)
        if indices is None:
            return self.classes
        pairs = sorted(set(zip(indices.tolist(), labels, strict=True)))
        if len(pairs) > len(set(labels)):
            raise ValueError(
                f"{self.where}: expected one class_index per label, found {pairs}"
            )
        return [label for _, label in pairs]

    def samples(self) -> dict[str, np.ndarray]:
        """All columns, and an order; sessions and groups of other names than numbers by rank.

        Raises:
            ValueError: one of :data:`KNOWN` is no number of each row: splits go by them.
        """
        samples = {"order": np.arange(self.n), **self.columns}
        for name in KNOWN:
            column = samples.get(name)
            if column is None:
                continue
            if name != "order" and column.dtype.kind == "U":
                names = normalised(column.tolist())
                self._check_complete(name, names)
                samples[f"{name}_name"] = np.array(names)
                samples[name] = natural_ranks(names)
            elif name in self.columns:
                numbers = self.numbers(name)
                samples[name] = numbers if column.dtype.kind == "U" else column
        return samples

    def _check_complete(self, name: str, texts: Sequence[str]) -> None:
        """Raise a ValueError where only some rows have a session or group."""
        missing = np.array([_is_missing(text) for text in texts])
        if missing.any() and not missing.all():
            first = int(missing.argmax())
            found = f"expected the {name} of each row, found {texts[first]!r}"
            raise ValueError(f"{self.place(first)}: {found}")

    def numeric(self) -> list[str]:
        """Names of the columns of numbers, but for those of :data:`KNOWN` and those without a name.

        Most cells of such a column are numbers, or are missing where there is a number.

        Raises:
            ValueError: a column of numbers has another cell.
        """
        names = []
        for name, column in self.columns.items():
            if name in KNOWN or is_unnamed(name) or not _is_mostly_numbers(column):
                continue
            self.numbers(name)
            names.append(name)
        return names

    def numbers(self, name: str) -> np.ndarray:
        """One column, float64 [N].

        Raises:
            SettingError: there is no such column.
            ValueError: naming the row of a cell that is no finite number.
        """
        column = self.columns.get(name)
        if column is None:
            wanted = f"columns or arrays [{self.n}]"
            raise SettingError(f"value_columns: expected {wanted}, found no {name}")
        if column.shape != (self.n,) or column.dtype.kind not in "iufU":
            found = f"{column.dtype} {column.shape}"
            raise ValueError(
                f"{self.where}: expected {self.n} numbers in the column {name}, found {found}"
            )
        if column.dtype.kind in "iuf":
            fits = np.isfinite(column)
        else:
            fits = np.array([parse_number(str(c)) is not None for c in column.tolist()])
        if not fits.all():
            first = int(fits.argmin())
            found = column.tolist()[first]
            raise ValueError(
                f"{self.place(first)}: expected a number in {name}, found {found!r}"
            )
        return column.astype(float)

    def values(self, names: Sequence[str]) -> np.ndarray | None:
        """Columns of numbers, float64 [N, k]; None of no columns."""
        if not names:
            return None
        return np.stack([self.numbers(name) for name in names], axis=1)


def _is_mostly_numbers(column: np.ndarray) -> bool:
    if column.dtype.kind != "U":
        return column.dtype.kind in "iuf"
    texts = column.tolist()
    numbers = sum(parse_number(text) is not None for text in texts)
    missing = sum(_is_missing(text) for text in texts)
    return numbers > 0 and 2 * (numbers + missing) > len(texts)


def class_indices(
    names: Sequence[str],
    where: object,
    fewest: int,
    order: Sequence[str] | None,
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names in natural order (or the given one), and the index of each sample's [N].

    The names are normalised already.

    Raises:
        ValueError: fewer classes than are needed, a name that is none of those given, or is empty.
    """
    if "" in names:
        wanted = "a label of each frame"
        raise ValueError(
            f"{where}: expected {wanted}, found none of frame {names.index('')}"
        )
    if order is None:
        classes = tuple(sorted(set(names), key=natural_key))
    else:
        classes = tuple(normalised(order))
    if len(classes) < fewest:
        found = f"only {classes[0]!r}" if classes else "none"
        raise ValueError(f"{where}: expected two classes or more, found {found}")
    if unknown := set(names) - set(classes):
        raise ValueError(
            f"{where}: expected one of the {len(classes)} classes, found {unknown}"
        )
    row_of = {name: row for row, name in enumerate(classes)}
    rows = [row_of[name] for name in names]
    return classes, np.array(rows, dtype=np.int64)


def is_unnamed(column: str) -> bool:
    """Whether nobody named a column; pandas writes its index so."""
    return not column or column.startswith("Unnamed: ")


def _is_missing(text: str) -> bool:
    return text.casefold() in _MISSING


def normalised(texts: Sequence[str]) -> list[str]:
    """Names in Unicode's composed form (NFC): an é of one code point or two is the same name."""
    return [unicodedata.normalize("NFC", text) for text in texts]


def natural_ranks(names: Sequence[str]) -> np.ndarray:
    """Rank [N] of each name among the different ones, in natural order."""
    different = sorted(set(names), key=natural_key)
    ranks = {name: rank for rank, name in enumerate(different)}
    return np.array([ranks[name] for name in names])


def typed(texts: Sequence[str]) -> np.ndarray:
    """Integers if all are, else finite numbers if all are, else text."""
    if all(_INTEGER.fullmatch(text) for text in texts):
        whole = [int(text) for text in texts]
        # Larger ones than 64 bits hold would be floats, of which many are equal.
        if all(-(2**63) <= number < 2**63 for number in whole):
            return np.array(whole, dtype=np.int64)
        return np.array(texts)
    numbers = [parse_number(text) for text in texts]
    if None in numbers:
        return np.array(texts)
    return np.array(numbers)
