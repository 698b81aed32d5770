"""Columns of a table as text, as people wrote them, and what they mean to a recording."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.files import natural_key, parse_number, read_csv

KNOWN = ("order", "session", "group")
"""Columns known by name, which are no numbers to learn."""
_INTEGER = re.compile(r"[-+]?\d+", re.ASCII)
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "inf", "+inf", "-inf"}
"""Texts for a missing number, in upper or lower case."""


@dataclass(frozen=True)
class Columns:
    """Texts of N rows by column, and the place of each row for errors."""

    places: Sequence[str]
    texts: dict[str, list[str]]

    @classmethod
    def read(cls, path: Path, required: Sequence[str] = ()) -> Columns:
        """The columns of a CSV; see :func:`hdc.readers.files.read_csv`."""
        found = list(read_csv(path, required))
        if not found:
            raise ValueError(f"{path}: expected a row per frame, found none")
        return cls.of([place for place, _ in found], [row for _, row in found])

    @classmethod
    def of(cls, places: Sequence[str], rows: Sequence[dict[str, str]]) -> Columns:
        """The columns of rows that all have the same names."""
        texts: dict[str, list[str]] = {name: [] for name in rows[0]}
        for row in rows:
            for name, text in row.items():
                texts[name].append(text)
        return cls(places, texts)

    def about(
        self, where: object, fewest_classes: int, value_columns: Sequence[str] | None
    ) -> dict[str, Any]:
        """Classes, labels, samples and values, as a recording takes them.

        Args:
            where: the table, for errors.
            fewest_classes: fewer are refused.
            value_columns: names of the columns to learn; all columns of numbers where it is None,
                or where it is empty and there are no labels.

        Raises:
            ValueError: there is nothing to learn, or a column is not as it has to be.
        """
        labels = self.pop_labels()
        samples = self.samples()
        check_known(where, samples, len(self.places))
        if value_columns is None or (labels is None and not value_columns):
            value_columns = self.numeric()
        if labels is None and not value_columns and fewest_classes > 0:
            raise ValueError(
                f"{where}: expected a label of each frame, or numbers to learn, found "
                f"{', '.join(self.texts) or 'neither'}"
            )
        classes: tuple[str, ...] = ()
        indices = None
        if labels is not None:
            order = self._class_order(where, labels, samples)
            classes, indices = class_indices(labels, where, fewest_classes, order)
        return {
            "classes": classes,
            "labels": indices,
            "samples": samples,
            "values": self.values(value_columns),
            "value_names": tuple(value_columns),
        }

    def _class_order(
        self, where: object, labels: Sequence[str], samples: dict[str, np.ndarray]
    ) -> list[str] | None:
        """Names of the classes in the order of a column class_index, if there is one."""
        indices = samples.pop("class_index", None)
        if indices is None:
            return None
        pairs = sorted(set(zip(indices.tolist(), labels, strict=True)))
        if len(pairs) > len(set(labels)):
            raise ValueError(
                f"{where}: expected one class_index per label, found {pairs}"
            )
        return [label for _, label in pairs]

    def only(self, names: Sequence[str]) -> Columns:
        """Those of these columns that are there."""
        texts = {name: self.texts[name] for name in names if name in self.texts}
        return Columns(self.places, texts)

    def pop_labels(self) -> list[str] | None:
        """Labels [N], removed from the columns; None where there are none."""
        texts = self.texts.pop("label", None)
        return None if texts is None else normalised(texts)

    def samples(self) -> dict[str, np.ndarray]:
        """Columns as numbers where they are; sessions and groups of other names by natural rank.

        Raises:
            ValueError: an order, session or group is missing from some rows only.
        """
        samples = {}
        for name, texts in self.texts.items():
            if name in KNOWN:
                self._check_complete(name)
            samples[name] = _numbers_or_text(texts)
            if name in ("session", "group") and samples[name].dtype.kind == "U":
                names = normalised(texts)
                samples[f"{name}_name"] = np.array(names)
                samples[name] = natural_ranks(names)
        return samples

    def _check_complete(self, name: str) -> None:
        missing = [_is_missing(text) for text in self.texts[name]]
        if any(missing) and not all(missing):
            first = missing.index(True)
            found = self.texts[name][first]
            raise ValueError(
                f"{self.places[first]}: expected the {name} of each row, found {found!r}"
            )

    def numeric(self) -> list[str]:
        """Names of the columns of numbers, but for those of :data:`KNOWN` and those without a name.

        Most cells of such a column are numbers, or are missing where there is a number.

        Raises:
            ValueError: a column of numbers has another cell.
        """
        names = []
        for name, texts in self.texts.items():
            numbers = sum(parse_number(text) is not None for text in texts)
            missing = sum(_is_missing(text) for text in texts)
            most = 2 * (numbers + missing) > len(texts)
            if name not in KNOWN and not is_unnamed(name) and numbers and most:
                self.numbers(name)
                names.append(name)
        return names

    def numbers(self, name: str) -> np.ndarray:
        """One column, float64 [N].

        Raises:
            ValueError: naming the row of a cell that is no finite number.
        """
        numbers = []
        for place, text in zip(self.places, self.texts[name], strict=True):
            number = parse_number(text)
            if number is None:
                raise ValueError(
                    f"{place}: expected a number in {name}, found {text!r}"
                )
            numbers.append(number)
        return np.array(numbers)

    def values(self, names: Sequence[str]) -> np.ndarray | None:
        """Columns of numbers, float64 [N, k]; None of no columns."""
        if not names:
            return None
        return np.stack([self.numbers(name) for name in names], axis=1)


def class_indices(
    names: Sequence[str],
    where: object,
    fewest: int = 2,
    order: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names in natural order (or the given one), and the index of each sample's [N].

    Raises:
        ValueError: fewer classes than are needed, a name that is none of those given, or is empty.
    """
    names = normalised(names)
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


def check_known(where: object, samples: Mapping[str, np.ndarray], n: int) -> None:
    """Raise a ValueError unless those of :data:`KNOWN` are N numbers: splits go by them."""
    for key in KNOWN:
        values = samples.get(key, np.zeros(n))
        if values.shape != (n,) or values.dtype.kind not in "iuf":
            found = f"{values.dtype} {values.shape}"
            raise ValueError(
                f"{where}: expected {n} numbers in the column {key}, found {found}"
            )
        finite = np.isfinite(values)
        if not finite.all():
            first = int(finite.argmin())
            raise ValueError(
                f"{where}: expected {n} finite numbers in the column {key}, found "
                f"{values[first]} for frame {first}"
            )


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


def _numbers_or_text(texts: list[str]) -> np.ndarray:
    """Integers if all are, else finite numbers if all are, else text."""
    if all(_INTEGER.fullmatch(text) for text in texts):
        with suppress(OverflowError):
            return np.array([int(text) for text in texts], dtype=np.int64)
    numbers = [parse_number(text) for text in texts]
    if None in numbers:
        return np.array(texts)
    return np.array(numbers)
