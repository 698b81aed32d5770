"""Labels, classes, values and other columns of the frames in a file of arrays."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.about import KNOWN, Columns, is_of_units, numbered
from hdc.readers.files import Ambiguous, BadFrame, wrong
from hdc.readers.settings import Asked
from hdc.readers.store import Store

LABELS = ("labels", "label")
"""Arrays that are taken for labels by their name."""
_OF_FILE = ("values", "value_names", "value_units")
"""Arrays that say something of the file, known by their names, and not of a frame each."""


def beside(path: Path, store: Store, asked: Asked, frames: str) -> dict[str, Any]:
    """The arrays of a file that say something of its `frames`, by their names in the group of HDF5,
    or struct of MATLAB, of these. The labels, as asked for or else one of :data:`LABELS`, are
    ``label``.

    Raises:
        BadFrame: one that is known by its name, or asked for, cannot be read.
        SettingError: there are no such labels.
    """
    group = frames[: frames.rfind("/") + 1]
    arrays = _of_group(store.arrays, group, frames)
    unread = _of_group(store.unread, group, frames)
    labels = asked.labels and asked.labels.removeprefix(group)
    chosen = {labels, asked.sessions, asked.groups, *(asked.values or ())}
    for name in unread.keys() & {*chosen, *LABELS, *_OF_FILE, *KNOWN}:
        raise BadFrame(f"{path}[{name}]: {unread[name]}")
    if labels is not None and labels not in arrays:
        names = ", ".join(arrays) or "no array"
        table = f"a table is named by --values, or lies beside it as {path.stem}.csv"
        raise wrong("labels", labels, f"one of {names} ({table})")
    own = labels or next((name for name in LABELS if name in arrays), None)
    if own is not None:
        arrays["label"] = arrays.pop(own)[...]
    return arrays


def _of_group(found: Mapping[str, Any], group: str, frames: str) -> dict[str, Any]:
    """Arrays in the group of the frames, by their names in it, and arrays in no group."""
    return {
        name.removeprefix(group): item
        for name, item in found.items()
        if name != frames and (name.startswith(group) or "/" not in name)
    }


def count(
    arrays: dict[str, Any], values: Sequence[str], shape: Sequence[int]
) -> int | None:
    """The number of frames in an array of a shape by their labels or values; None where nothing
    says so, such as one label of all frames."""
    for name in ("label", "values", *values):
        if name in arrays and arrays[name].shape:
            n = int(arrays[name].shape[0])
            return n if n > 1 or 1 in shape else None
    return None


def columns_of(path: Path, arrays: dict[str, Any], n: int) -> Columns:
    """Columns of N frames, of the arrays of a file.

    Args:
        path: of the file, for errors.
        arrays: by name, as of :func:`beside`.
        n: N.

    Raises:
        ValueError: labels or values are not as described.
    """
    of_each = {k: _of_each(a, n) for k, a in arrays.items() if k not in _OF_FILE}
    columns = {
        name: array
        for name, array in of_each.items()
        if name in KNOWN or (array.shape == (n,) and array.dtype.kind in "iufU")
    }
    values, units = _values(path, arrays, n) if "values" in arrays else ({}, {})
    if "label" in arrays:
        columns["label"] = _labels(path, of_each["label"], n)
        if arrays["label"].dtype.kind != "U" and "classes" in arrays:
            wanted = "labels that are names, such as classes[labels]"
            raise ValueError(f"{path}[classes]: expected {wanted}, found numbers")
    return Columns(
        where=path,
        n=n,
        place=lambda i: f"{path}, frame {i}",
        columns=columns | values,
        units=units,
        learnt=tuple(values),
    )


def _values(
    path: Path, arrays: dict[str, Any], n: int
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The columns of the array ``values`` [N, k] by name, and their units."""
    table = np.asarray(arrays["values"][...])
    if table.ndim not in (1, 2) or len(table) != n:
        found = f"{table.dtype} {table.shape}"
        raise ValueError(f"{path}[values]: expected shape ({n}, k), found {found}")
    table = table.reshape(n, -1)
    names = _texts(arrays, "value_names") or numbered(table.shape[1])
    units = _texts(arrays, "value_units") or [""] * len(names)
    if not len({*names}) == len(units) == table.shape[1]:
        wanted = f"a name and a unit for each of {table.shape[1]} columns"
        found = f"{names} and {units}"
        raise ValueError(f"{path}[value_names]: expected {wanted}, found {found}")
    pairs = dict(zip(names, table.T, strict=True))
    return pairs, dict(zip(names, units, strict=True))


def _of_each(array: Any, n: int) -> Any:
    """The same array; one number or text alone as that of each of N frames."""
    if math.prod(array.shape) != 1:
        return array
    return np.broadcast_to(np.ravel(array[...]), (n,))


def _labels(path: Path, labels: np.ndarray, n: int) -> np.ndarray:
    """Names [N] of the classes."""
    # MATLAB's numbers are floats, which tell whole numbers below 2**53 apart.
    if labels.dtype.kind == "f" and (np.abs(labels) < 2**53).all():
        whole = labels.astype(np.int64)
        labels = whole if np.array_equal(whole, labels) else labels
    if labels.shape != (n,) or labels.dtype.kind not in "iuU":
        found = f"{labels.dtype} {labels.shape}"
        raise ValueError(
            f"{path}[labels]: expected integers or strings ({n},), found {found}"
        )
    return labels.astype(str)


def _texts(arrays: dict[str, Any], name: str) -> list[str]:
    """The items of an array as text; none where there is no such array."""
    return [*map(str, np.ravel(arrays[name][...]))] if name in arrays else []


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
    if choices := _choices(store, shape):
        raise Ambiguous(f"{path}: {n} frames and no array labels", choices)
    raise ValueError(
        f"{path}: expected arrays frames and labels, found no labels "
        f"(or {path.stem}.csv with a row for each of {n} frames)"
    )


def _choices(store: Store, lengths: Sequence[int]) -> list[str]:
    """Options that name what can be learnt: arrays of one of these lengths."""
    choices = []
    for name, array in store.arrays.items():
        if len(array.shape) != 1 or len(array) not in lengths:
            continue
        if name in KNOWN or is_of_units(name):
            continue
        word = shlex.quote(name)
        if len(np.unique(array)) < len(array):
            choices.append(f"--labels {word}")
        if array.dtype.kind in "iuf":
            choices.append(f"--column {word}")
    return choices
