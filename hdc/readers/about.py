"""Statements on frames, besides their pixels: labels, values, order, sessions, groups.

Whatever a file is, its statements become :class:`Columns` of numbers or text, of which
:meth:`Columns.about` makes the typed :class:`About` of a recording.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hdc.readers.files import SettingError, wrong
from hdc.readers.table import Rows, parse_number, read_csv

KNOWN = ("order", "session", "group")
"""Columns known by name, which are no numbers to learn."""
_NAMES = ("label", "file")
_OF_FRAME = ("frame", "time")
"""Columns that say which frame it is: neither are these, unless they are named."""
_INTEGER = re.compile(r"[-+]?\d+", re.ASCII)
_OF_UNITS = re.compile(
    r"(?:^|[^a-z])(?:session|trial|run|day|date|take|rep|repetition|batch|block|visit)s?"
    r"(?:[^a-z]|no|nr|id|num|number|$)"
)
"""Names of columns that number recordings, in lower case."""


@dataclass(frozen=True)
class About:
    """Labels, values and other columns of N frames.

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
        learnt: names that are learnt where none is asked for; None means all numbers.
    """

    where: object
    n: int
    place: Callable[[int], str]
    columns: dict[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    learnt: Sequence[str] | None = None

    @classmethod
    def read(cls, path: Path, required: Sequence[str] = ()) -> Columns:
        """The columns of a CSV; see :func:`hdc.readers.table.read_csv`."""
        return cls.of_rows(path, read_csv(path, required))

    @classmethod
    def of_rows(cls, where: object, rows: Rows) -> Columns:
        """The columns of rows of text that all have the same names, as numbers where all cells are;
        labels and files stay text."""
        if not rows:
            raise ValueError(f"{where}: expected a row per frame, found none")
        columns = {}
        for name in rows[0][1]:
            cells = [row[name] for _, row in rows]
            columns[name] = np.array(cells) if name in _NAMES else typed(cells)
        return cls(where, len(rows), lambda i: rows[i][0], columns)

    def take(self, rows: np.ndarray) -> Columns:
        """The columns of these rows [n]."""
        kept = {name: column[rows] for name, column in self.columns.items()}
        return replace(
            self, n=len(rows), place=lambda i: self.place(int(rows[i])), columns=kept
        )

    def known_as(self, **wanted: str | None) -> Columns:
        """These, of which those that are wanted are ``label``, ``session`` and ``group``.

        Raises:
            SettingError: there is no such column.
        """
        columns = dict(self.columns)
        for known, name in wanted.items():
            if name is not None and name not in self.columns:
                names = ", ".join(self.columns) or "no array"
                raise wrong(
                    f"{known}s", name, f"one of {names} (--values names a table)"
                )
            if name is not None:
                columns.pop(name, None)
                columns[known] = self.columns[name]
        return replace(self, columns=columns)

    def about(self, values: Sequence[str], fewest_classes: int) -> About:
        """The labels, values and samples that the columns are.

        Args:
            values: names of the columns to learn; by default the columns in :attr:`learnt`.
            fewest_classes: fewer are refused; with 0 neither labels nor values are needed.

        Raises:
            ValueError: there is nothing to learn, or a column is not as it has to be.
        """
        names = values or (self.numeric() if self.learnt is None else self.learnt)
        samples, units = self._samples(), [self.units.get(name, "") for name in names]
        classes: tuple[str, ...] = ()
        labels = None
        if "label" in self.columns:
            classes, labels = self._classes(samples, fewest_classes)
        elif fewest_classes > 0 and not names:
            raise ValueError(
                f"{self.where}: expected a label of each frame, or numbers to learn, found "
                f"{', '.join(self.columns) or 'neither'} (--labels or --column names them)"
            )
        numbers = self.values(names)
        return About(samples, classes, labels, numbers, tuple(names), tuple(units))

    def _classes(
        self, samples: dict[str, np.ndarray], fewest: int
    ) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the classes, by a column class_index or in natural order; and the index of each
        label [N]."""
        names = self._names()
        if "" in names:
            found = f"none of frame {names.index('')}"
            raise ValueError(
                f"{self.where}: expected a label of each frame, found {found}"
            )
        classes = sorted({*names}, key=natural_key)
        indices = samples.pop("class_index", None)
        if indices is not None:
            pairs = sorted(set(zip(indices.tolist(), names, strict=True)))
            if len(pairs) > len(classes):
                raise ValueError(
                    f"{self.where}: expected one class_index per label, found {pairs}"
                )
            classes = [name for _, name in pairs]
        if len(classes) < fewest:
            found = ", ".join(classes)
            raise ValueError(
                f"{self.where}: expected two classes or more, found only {found!r}"
            )
        return tuple(classes), _places(names, classes)

    def _names(self) -> list[str]:
        """Name of the class of each frame [N]."""
        labels = self.columns["label"]
        # MATLAB's numbers are floats, which tell whole numbers below 2**53 apart.
        if labels.dtype.kind == "f" and (np.abs(labels) < 2**53).all():
            whole = labels.astype(np.int64)
            labels = whole if np.array_equal(whole, labels) else labels
        if labels.shape != (self.n,) or labels.dtype.kind not in "iuU":
            wanted = f"labels that are integers or strings ({self.n},)"
            found = f"{labels.dtype} {labels.shape}"
            raise ValueError(f"{self.where}: expected {wanted}, found {found}")
        return normalised(labels)

    def _samples(self) -> dict[str, np.ndarray]:
        """All columns, and an order; sessions and groups of other names than numbers by rank.

        Raises:
            ValueError: one of :data:`KNOWN` is no number of each row: splits go by them.
        """
        samples = {"order": np.arange(self.n), **self.columns}
        samples.pop("label", None)
        for name in KNOWN:
            column = self.columns.get(name)
            if column is None:
                continue
            if name == "order" or column.dtype.kind != "U":
                numbers = self.numbers(name)
                samples[name] = numbers if column.dtype.kind == "U" else column
                continue
            names = normalised(column)
            if "" in names:
                place = self.place(names.index(""))
                raise ValueError(f"{place}: expected the {name} of each row, found ''")
            samples[f"{name}_name"] = np.array(names)
            samples[name] = _places(names, sorted(set(names), key=natural_key))
        return samples

    def numeric(self) -> list[str]:
        """Names of the columns of numbers, without those that are known and those without a name.

        One number makes a column one of numbers, so that a cell that is none is not overlooked.
        Beside labels, which are learnt, all cells have to be numbers: others are a comment.
        """
        known = (*KNOWN, *_NAMES, *_OF_FRAME)
        enough = all if "label" in self.columns else any
        return [
            name
            for name, column in self.columns.items()
            if name not in known
            and not is_unnamed(name)
            and enough(_numbers_in(column))
        ]

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
        is_text = column.dtype.kind == "U"
        fits = _numbers_in(column) if is_text else np.isfinite(column).tolist()
        if not all(fits):
            first = fits.index(False)
            found = f"expected a number in {name}, found {column.tolist()[first]!r}"
            hint = "--labels names the labels, --column what is learnt"
            raise ValueError(f"{self.place(first)}: {found} ({hint})")
        return column.astype(float)

    def values(self, names: Sequence[str]) -> np.ndarray | None:
        """Columns of numbers, float64 [N, k]; None of no columns."""
        columns = [self.numbers(name) for name in names]
        return np.stack(columns, axis=1) if columns else None


def _numbers_in(column: np.ndarray) -> list[bool]:
    """Whether each cell of a column is a number."""
    if column.dtype.kind == "U":
        return [parse_number(text) is not None for text in column.tolist()]
    return [column.dtype.kind in "iuf"] * len(column)


def is_unnamed(column: str) -> bool:
    """Whether nobody named a column; pandas writes its index so."""
    return not column or column.startswith("Unnamed: ")


def is_of_units(column: str) -> bool:
    """Whether a column's name says that it numbers recordings, such as ``trial`` or ``runNo``."""
    return _OF_UNITS.search(column.lower()) is not None


def normalised(texts: Sequence[str] | np.ndarray) -> list[str]:
    """Names in Unicode's composed form (NFC): an é of one code point or two is the same name."""
    return [unicodedata.normalize("NFC", str(text)) for text in texts]


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts frame2 before frame10, whatever the locale."""
    key = [
        (0, int(part), part) if part.isdecimal() else (1, 0, part.casefold())
        for part in re.split(r"([0-9]+)", name)
        if part
    ]
    return (*key, (2, 0, name))  # Frame1 and frame1 in a fixed order


def path_key(file: str) -> list[tuple[tuple[int, int, str], ...]]:
    """Sort key of paths, part by part."""
    return [*map(natural_key, file.split("/"))]


def grouped(about: About, parts: np.ndarray) -> tuple[About, list[str]]:
    """Frames whose `parts` [N], such as files, are groups, or the groups in each part; and a note.

    The frames of a class with a single part are split. Where all classes are such, the parts are
    no groups.
    """
    own = about.samples.get("group")
    if own is not None:
        parts = np.unique(np.stack([parts, own]), axis=1, return_inverse=True)[1]
    found = "each class"
    labels = np.zeros(len(parts), int) if about.labels is None else about.labels
    pairs = np.unique(np.stack([labels, parts]), axis=1)
    alone = np.bincount(pairs[0])[labels] == 1
    samples = {k: column for k, column in about.samples.items() if k != "group"}
    if not alone.all():
        apart = parts.max() + 1 + np.arange(len(parts))
        samples["group"] = np.where(alone, apart, parts)
        found = ", ".join(about.classes[c] for c in np.unique(labels[alone]))
    note = f"{found}: recorded once, so its frames are split"
    return replace(about, samples=samples), [note] if alone.any() else []


def _places(names: Sequence[str], different: Sequence[str]) -> np.ndarray:
    """Place [N] of each name among the different ones."""
    place_of = {name: place for place, name in enumerate(different)}
    return np.array([place_of[name] for name in names], dtype=np.int64)


def typed(texts: Sequence[str]) -> np.ndarray:
    """Integers if all are, else finite numbers if all are, else text."""
    if all(map(_INTEGER.fullmatch, texts)):
        whole = np.array([*map(int, texts)])
        # Larger ones than 64 bits hold would be floats, of which many are equal.
        return whole if whole.dtype == np.int64 else np.array(texts)
    numbers = [parse_number(text) for text in texts]
    return np.array(texts if None in numbers else numbers)


def numbered(n: int) -> list[str]:
    """Names of columns that have none."""
    return ["value"] if n == 1 else [f"value_{k}" for k in range(n)]
