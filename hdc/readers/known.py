"""Labels and other columns of the frames of an array: from the same file, or from a table."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.axes import ALONG
from hdc.readers.columns import (
    KNOWN,
    Columns,
    check_known,
    class_indices,
    natural_ranks,
)
from hdc.readers.files import Ambiguous, SettingError, columns_of
from hdc.readers.stores import Store

LABELS = ("labels", "label")
"""Arrays that are taken for labels by their name."""


class Known:
    """Labels, values and samples of the frames: arrays of the file, or columns of a table.

    Attributes:
        count: how many frames they are of; None where nothing says so.
    """

    def __init__(
        self,
        path: Path,
        store: Store,
        labels: str | None,
        table: Path | None,
        value_columns: Sequence[str] | None,
        fewest_classes: int,
    ) -> None:
        self._path, self._store, self._fewest = path, store, fewest_classes
        self._value_columns = value_columns
        self._arrays = {
            name: _vector(array, store.frames_last)
            for name, array in store.arrays.items()
        }
        own = [labels] if labels else [k for k in LABELS if k in self._arrays]
        if labels is not None and labels not in self._arrays:
            listed = ", ".join(self._arrays) or "no array"
            raise SettingError(f"labels: expected one of {listed}, found {labels!r}")
        self._labels = self._arrays.pop(own[0]) if own else None
        self._table = table
        beside = path.with_suffix(".csv")
        has_own = self._labels is not None or "values" in self._arrays
        if table is None and not has_own and "label" in columns_of(beside):
            self._table = beside
        self._columns = None if self._table is None else Columns.read(self._table)
        self.count = self._count()

    def _count(self) -> int | None:
        if self._columns is not None:
            return len(self._columns.places)
        names = ("values", *(self._value_columns or ()))
        known = [self._labels, *(self._arrays.get(name) for name in names)]
        shapes = [array.shape for array in known if array is not None]
        return next((shape[0] for shape in shapes if shape), None)

    def about(
        self,
        n: int,
        axes: Sequence[str],
        counts: Sequence[int],
        shape: Sequence[int],
    ) -> dict[str, Any]:
        """Classes, labels, samples and values of N frames, as a recording takes them.

        Args:
            n: the number of frames.
            axes, shape: of their array.
            counts: lengths of the axes along the frames.
        """
        path, value_columns = self._path, self._value_columns
        if self._columns is not None and self._table is not None:
            return _of_table(self._table, self._columns, n, self._fewest, value_columns)
        value_columns = value_columns or ()
        if axes[0] != "frame" or len(counts) > 1:
            self._take_places(axes, counts)
            if "value" in axes and not value_columns:
                value_columns = ("value",)
        classes, labels = self._class_labels(n)
        named, units = _named_values(path, self._arrays, n)
        if labels is None:
            value_columns = value_columns or tuple(named)
            self._check_learnt(value_columns, n, shape)
        known = self._arrays | named
        samples = _samples(known, n)
        check_known(path, samples, n)
        return {
            "classes": classes,
            "labels": labels,
            "samples": samples,
            "values": _values(path, known, value_columns, n),
            "value_names": tuple(value_columns),
            "value_units": tuple(units.get(name, "") for name in value_columns),
        }

    def _take_places(self, axes: Sequence[str], counts: Sequence[int]) -> None:
        """Place along each axis of frames, of every frame [N]; that along label: the label."""
        along = [axis for axis in axes if axis in ALONG]
        places = np.indices(counts).reshape(len(along), -1)
        for axis, place in zip(along, places, strict=True):
            if axis == "label":
                self._labels = place
            elif axis != "frame":
                self._arrays[axis] = place

    def _check_learnt(
        self, value_columns: Sequence[str], n: int, shape: Sequence[int]
    ) -> None:
        """Raise a ValueError where there is nothing to learn, and something is needed."""
        if self._fewest == 0 or value_columns:
            return
        choices = self._choices([n]) or self._choices(shape)
        if choices:
            raise Ambiguous(f"{self._path}: {n} frames and no array labels", choices)
        raise ValueError(
            f"{self._path}: expected arrays frames and labels, found no labels "
            f"(--labels FILE.csv with a row for each of {n} frames){self._store.advice()}"
        )

    def _choices(self, lengths: Sequence[int]) -> list[str]:
        """Options that name what can be learnt: arrays of one of these lengths."""
        choices = []
        for name, array in self._arrays.items():
            if len(array.shape) == 1 and len(array) in lengths and name not in KNOWN:
                word = shlex.quote(name)
                repeats = len(np.unique(array)) < len(array)
                choices += [f"--labels {word}"] if repeats else []
                choices += [f"--column {word}"] if array.dtype.kind in "iuf" else []
        return choices

    def _class_labels(self, n: int) -> tuple[tuple[str, ...], np.ndarray | None]:
        """Class names, and the index of each frame's [N].

        Integers count the names in `classes` from 0; those of MATLAB from 1, unless one is 0.
        """
        labels, where = self._labels, f"{self._path}[labels]"
        names = self._arrays.get("classes")
        if labels is None:
            return (), None
        fits = labels.shape == (n,)
        if fits and labels.dtype.kind == "f" and _are_whole(labels):
            labels = labels.astype(np.int64)  # MATLAB's numbers are floats
        if not fits or labels.dtype.kind not in "iuU":
            found = f"{labels.dtype} {labels.shape}"
            raise ValueError(
                f"{where}: expected integers or strings ({n},), found {found}"
            )
        classes = None if names is None else _texts(names)
        if classes is not None and len(set(classes)) < len(classes):
            raise ValueError(
                f"{self._path}[classes]: expected different names, found {classes}"
            )
        integers = labels.dtype.kind != "U"
        from_one = self._store.frames_last and integers and labels.min() > 0
        by_number = dict(enumerate(classes or (), start=int(from_one)))
        texts = [str(by_number.get(label, label)) for label in labels.tolist()]
        return class_indices(texts, where, self._fewest, classes)


def _are_whole(numbers: np.ndarray) -> bool:
    return bool((np.isfinite(numbers) & (numbers == np.round(numbers))).all())


def _vector(array: Any, of_matlab: bool) -> Any:
    """A column or a row of MATLAB as a vector [N], in memory; other arrays as they are."""
    if len(array.shape) == 1:
        return np.asarray(array[:])
    if of_matlab and len(array.shape) == 2 and 1 in array.shape:
        return np.asarray(array[:, :]).ravel()
    return array


def _of_table(
    table: Path,
    columns: Columns,
    n: int,
    fewest_classes: int,
    value_columns: Sequence[str] | None,
) -> dict[str, Any]:
    """Columns of a table with a row per frame."""
    if len(columns.places) != n:
        raise ValueError(
            f"{table}: expected {n} rows, one per frame, found {len(columns.places)}"
        )
    numbers = columns.texts.pop("frame", None)
    if numbers is not None and numbers != [str(i) for i in range(n)]:
        raise ValueError(
            f"{table}: expected rows in the order of the frames, numbered from 0 to {n - 1} in the "
            f"column frame, found {numbers[0]} to {numbers[-1]}"
        )
    return columns.about(table, fewest_classes, value_columns)


def _named_values(
    path: Path, arrays: dict[str, np.ndarray], n: int
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns [N] of the array ``values`` and their units, by name; taken out of the arrays."""
    values = arrays.pop("values", None)
    names = arrays.pop("value_names", None)
    units = arrays.pop("value_units", None)
    if values is None:
        return {}, {}
    values = np.asarray(values[...])
    if values.ndim not in (1, 2) or len(values) != n:
        found = f"{values.dtype} {values.shape}"
        raise ValueError(f"{path}[values]: expected shape ({n}, k), found {found}")
    columns = values.reshape(n, -1).T
    titles = numbered(len(columns)) if names is None else _texts(names)
    if len(titles) != len(columns) or len(set(titles)) < len(titles):
        wanted = f"{len(columns)} different names, one a column of values"
        raise ValueError(f"{path}[value_names]: expected {wanted}, found {titles}")
    by_name = dict(zip(titles, columns, strict=True))
    if units is None:
        return by_name, {}
    symbols = _texts(units)
    if len(symbols) != len(columns):
        wanted = f"{len(columns)} units, one a column of values"
        raise ValueError(f"{path}[value_units]: expected {wanted}, found {symbols}")
    return by_name, dict(zip(titles, symbols, strict=True))


def _texts(array: np.ndarray) -> list[str]:
    return [str(text) for text in np.ravel(array).tolist()]


def numbered(n: int) -> list[str]:
    """Names of columns that have none."""
    return ["value"] if n == 1 else [f"value_{k}" for k in range(n)]


def _values(
    path: Path, arrays: dict[str, np.ndarray], columns: Sequence[str], n: int
) -> np.ndarray | None:
    """The chosen columns of numbers, float64 [N, k]; None of no columns."""
    if not columns:
        return None
    fitting = {name for name, array in arrays.items() if array.shape == (n,)}
    wrong = [name for name in columns if name not in fitting]
    if wrong:
        raise SettingError(
            f"value_columns: expected arrays [{n}], found no {', '.join(wrong)}"
        )
    for name in columns:
        kind = arrays[name].dtype
        if kind.kind not in "iuf":
            raise ValueError(f"{path}[{name}]: expected numbers, found {kind}")
        finite = np.isfinite(arrays[name])
        if not finite.all():
            first = int(finite.argmin())
            found = f"{arrays[name][first]} for frame {first}"
            raise ValueError(f"{path}[{name}]: expected finite numbers, found {found}")
    return np.stack([arrays[name].astype(float) for name in columns], axis=1)


def _samples(arrays: dict[str, np.ndarray], n: int) -> dict[str, np.ndarray]:
    """Columns that are kept: those of :data:`KNOWN` in any case, and arrays [N]."""
    samples = {}
    for name, array in arrays.items():
        fits = array.shape == (n,) and array.dtype.kind in "iufU"
        if fits or name in KNOWN:
            samples[name] = array
        if fits and name in ("session", "group") and array.dtype.kind == "U":
            samples[f"{name}_name"] = array
            samples[name] = natural_ranks(array.tolist())
    return samples
