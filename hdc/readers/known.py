"""What a file of arrays says of the frames in it: labels, classes, values, and other columns."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.about import KNOWN, Columns
from hdc.readers.files import Ambiguous, SettingError
from hdc.readers.stores import Refused, Store

LABELS = ("labels", "label")
"""Arrays that are taken for labels by their name."""


def beside(store: Store, labels: str | None, group: str) -> dict[str, Any]:
    """The arrays of a file without its frames, vectors in memory; the labels are ``label``.

    They are those of this name, with the `group` of the frames or without, or else of one of
    :data:`LABELS`.
    """
    arrays = {
        name: _vector(array, store.frames_last) for name, array in store.arrays.items()
    }
    labels = labels and labels.removeprefix(group)
    if labels is not None and labels not in arrays:
        listed = ", ".join(arrays) or "no array"
        raise SettingError(f"labels: expected one of {listed}, found {labels!r}")
    _check_needed(arrays)
    own = labels or next((name for name in LABELS if name in arrays), None)
    if own is not None:
        arrays["label"] = arrays.pop(own)[...]
    return arrays


def _check_needed(arrays: dict[str, Any]) -> None:
    """Raise a BadFrame for an array that is known by its name and cannot be read."""
    for name in ("classes", "values", "value_names", "value_units", *KNOWN):
        if isinstance(arrays.get(name), Refused):
            arrays[name][...]  # says why


def count(arrays: dict[str, Any], values: Sequence[str]) -> int | None:
    """The number of frames that labels or values are of; None where nothing says so."""
    for name in ("label", "values", *values):
        if name in arrays and arrays[name].shape:
            return int(arrays[name].shape[0])
    return None


def columns_of(path: Path, arrays: dict[str, Any], n: int, from_one: bool) -> Columns:
    """Columns of N frames, of the arrays of a file.

    Args:
        path: of the file, for errors.
        arrays: by name, as of :func:`beside`; places along axes are among them.
        n: N.
        from_one: whether numbers of classes count from 1, unless one is 0.

    Raises:
        ValueError: labels, classes or values are not as described.
    """
    names = arrays.pop("classes", None)
    classes = None if names is None else texts_of(names)
    if classes is not None and len(set(classes)) < len(classes):
        raise ValueError(f"{path}[classes]: expected different names, found {classes}")
    labels = arrays.pop("label", None)
    values, units = _values(path, arrays, n)
    columns = {}
    for name, array in (arrays | values).items():
        fits = array.shape == (n,) and array.dtype.kind in "iufU"
        if isinstance(array, Refused):
            continue
        if fits or name in KNOWN:
            columns[name] = array
    if labels is not None:
        columns["label"] = _labels(path, labels, n, classes, from_one)
    return Columns(
        where=path,
        n=n,
        place=lambda i: f"{path}, frame {i}",
        columns=columns,
        units=units,
        learnt=tuple(values),
        classes=classes,
    )


def _vector(array: Any, of_matlab: bool) -> Any:
    """A column or a row of MATLAB as a vector [N], in memory; other arrays as they are."""
    if isinstance(array, Refused):
        return array
    if len(array.shape) == 1:
        return np.asarray(array[:])
    if of_matlab and len(array.shape) == 2 and 1 in array.shape:
        return np.asarray(array[:, :]).ravel()
    return array


def _labels(
    path: Path,
    labels: np.ndarray,
    n: int,
    classes: Sequence[str] | None,
    from_one: bool,
) -> np.ndarray:
    """Names [N] of the classes; whole numbers count those that are named."""
    fits = labels.shape == (n,)
    if fits and labels.dtype.kind == "f" and _are_whole(labels):
        labels = labels.astype(np.int64)  # MATLAB's numbers are floats
    if not fits or labels.dtype.kind not in "iuU":
        found = f"{labels.dtype} {labels.shape}"
        raise ValueError(
            f"{path}[labels]: expected integers or strings ({n},), found {found}"
        )
    first = int(from_one and labels.dtype.kind != "U" and labels.min() > 0)
    by_number = dict(enumerate(classes or (), start=first))
    return np.array([str(by_number.get(label, label)) for label in labels.tolist()])


def _are_whole(numbers: np.ndarray) -> bool:
    """Whether all are whole numbers that a float tells apart."""
    exact = np.abs(numbers) < 2**53
    return bool((exact & (numbers == np.round(numbers))).all())


def _values(
    path: Path, arrays: dict[str, Any], n: int
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
    titles = numbered(len(columns)) if names is None else texts_of(names)
    symbols = [""] * len(columns) if units is None else texts_of(units)
    _check_one_each(f"{path}[value_names]", columns, titles, "different names")
    _check_one_each(f"{path}[value_units]", columns, symbols, "units")
    by_name = dict(zip(titles, columns, strict=True))
    return by_name, dict(zip(titles, symbols, strict=True))


def _check_one_each(
    where: str, columns: np.ndarray, texts: list[str], what: str
) -> None:
    """Raise a ValueError unless there is a text, or another one, for each column."""
    repeated = what.startswith("different") and len(set(texts)) < len(texts)
    if len(texts) != len(columns) or repeated:
        wanted = f"{len(columns)} {what}, one a column of values"
        raise ValueError(f"{where}: expected {wanted}, found {texts}")


def texts_of(array: np.ndarray) -> list[str]:
    """The items of an array, as text."""
    return [str(text) for text in np.ravel(array).tolist()]


def numbered(n: int) -> list[str]:
    """Names of columns that have none."""
    return ["value"] if n == 1 else [f"value_{k}" for k in range(n)]


def check_learnt(
    path: Path, store: Store, columns: Columns, shape: Sequence[int]
) -> None:
    """Raise a ValueError where there is nothing to learn; arrays that could be are named.

    Args:
        path: of the file.
        store: its arrays.
        columns: of its frames.
        shape: of the array of frames.
    """
    if "label" in columns.columns or columns.learnt:
        return
    n = columns.n
    choices = _choices(store, [n]) or _choices(store, shape)
    if choices:
        raise Ambiguous(f"{path}: {n} frames and no array labels", choices)
    raise ValueError(
        f"{path}: expected arrays frames and labels, found no labels "
        f"(--labels FILE.csv with a row for each of {n} frames){store.advice()}"
    )


def _choices(store: Store, lengths: Sequence[int]) -> list[str]:
    """Options that name what can be learnt: arrays of one of these lengths."""
    choices = []
    for name, array in store.arrays.items():
        array = _vector(array, store.frames_last)
        if len(array.shape) != 1 or len(array) not in lengths or name in KNOWN:
            continue
        word = shlex.quote(name)
        if len(np.unique(array)) < len(array):
            choices.append(f"--labels {word}")
        if array.dtype.kind in "iuf":
            choices.append(f"--column {word}")
    return choices
