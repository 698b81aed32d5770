"""Labels, classes, values and other columns of the frames in a file of arrays."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.about import KNOWN, Columns, is_of_units, numbered
from hdc.readers.files import Ambiguous, BadFrame
from hdc.readers.recording import Asked
from hdc.readers.store import Store

_OF_FILE = ("values", "value_names", "value_units")
"""Arrays that say something of the file, known by their names, and not of a frame each."""


def beside(path: Path, store: Store, asked: Asked, frames: str) -> dict[str, Any]:
    """The arrays of a file that say something of its `frames`, by their names in the group of HDF5,
    or struct of MATLAB, of these. Those named ``labels`` are ``label``, unless others are asked
    for.

    Raises:
        BadFrame: one that is known by its name, or asked for, cannot be read.
    """
    group = frames[: frames.rfind("/") + 1]
    arrays = _of_group(store.arrays, group, frames)
    unread = _of_group(store.unread, group, frames)
    chosen = {asked.labels, asked.sessions, asked.groups, *asked.values}
    for name in unread.keys() & {*chosen, "labels", "label", *_OF_FILE, *KNOWN}:
        raise BadFrame(f"{path}[{name}]: {unread[name]}")
    if asked.labels is None and "labels" in arrays:
        arrays["label"] = arrays.pop("labels")
    return arrays


def _of_group(found: Mapping[str, Any], group: str, frames: str) -> dict[str, Any]:
    """Arrays in the group of the frames, by their names in it, and arrays in no group."""
    return {
        name.removeprefix(group): item
        for name, item in found.items()
        if name != frames and (name.startswith(group) or "/" not in name)
    }


def count(arrays: dict[str, Any], asked: Asked, shape: Sequence[int]) -> int | None:
    """The number of frames in an array of a shape by their labels or values; None where nothing
    says so, such as one label of all frames."""
    for name in (asked.labels, "label", "values", *asked.values):
        if name in arrays and arrays[name].shape:
            n = int(arrays[name].shape[0])
            return n if n > 1 or 1 in shape else None
    return None


def columns_of(path: Path, arrays: dict[str, Any], n: int, asked: Asked) -> Columns:
    """Columns of N frames, of the arrays of a file.

    Args:
        path: of the file, for errors.
        arrays: by name, as of :func:`beside`.
        n: N.
        asked: names arrays that are labels.

    Raises:
        ValueError: values are not as described, or labels are numbers of names beside them.
    """
    known = ("label", asked.labels, *KNOWN)
    of_each = {k: _of_each(a, n) for k, a in arrays.items() if k not in _OF_FILE}
    columns = {
        name: np.asarray(array[...])
        for name, array in of_each.items()
        if name in known or (array.shape == (n,) and array.dtype.kind in "iufU")
    }
    kinds = {name: arrays[name].dtype.kind for name in arrays}
    if kinds.get("classes") == "U" != kinds.get(asked.labels or "label", "U"):
        wanted = "labels that are names, such as classes[labels]"
        raise ValueError(f"{path}[classes]: expected {wanted}, found numbers")
    values, units = _values(path, arrays, n) if "values" in arrays else ({}, {})
    return Columns(
        where=path,
        n=n,
        place=lambda i: f"{path}, frame {i}",
        columns=columns | values,
        units=units,
        learnt=() if "label" in columns else tuple(values),
    )


def _values(
    path: Path, arrays: dict[str, Any], n: int
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The columns of the array ``values`` [N, k] by name, and their units."""
    columns = np.atleast_2d(np.asarray(arrays["values"][...]).T)
    k = len(columns)
    names = _texts(arrays, "value_names") or numbered(k)
    units = _texts(arrays, "value_units") or [""] * k
    if columns.shape[1:] != (n,) or not len({*names}) == len(units) == k:
        found = f"{columns.T.shape}, {names} and {units}"
        raise ValueError(
            f"{path}[values]: expected shape ({n}, k), k different names and k units, found {found}"
        )
    return dict(zip(names, columns, strict=True)), dict(zip(names, units, strict=True))


def _texts(arrays: dict[str, Any], name: str) -> list[str]:
    """The items of an array as text; none where there is no such array."""
    return [*map(str, np.ravel(arrays[name][...]))] if name in arrays else []


def _of_each(array: Any, n: int) -> Any:
    """The same array; one number or text alone as that of each of N frames."""
    if math.prod(array.shape) != 1:
        return array
    return np.broadcast_to(np.ravel(array[...]), (n,))


def check_learnt(
    path: Path, arrays: dict[str, Any], columns: Columns, shape: Sequence[int]
) -> None:
    """Raise a ValueError where there is nothing to learn; arrays that could be are named.

    Args:
        path: of the file.
        arrays: by name, as of :func:`beside`.
        columns: of its frames.
        shape: of the array of frames.
    """
    if "label" in columns.columns or columns.learnt:
        return
    n = columns.n
    if choices := _choices(arrays, shape):
        raise Ambiguous(f"{path}: {n} frames and no array labels", choices)
    raise ValueError(
        f"{path}: expected arrays frames and labels, found no labels "
        f"(or {path.stem}.csv with a row for each of {n} frames)"
    )


def _choices(arrays: dict[str, Any], lengths: Sequence[int]) -> list[str]:
    """Options that name what can be learnt: arrays of one of these lengths."""
    choices = []
    for name, array in arrays.items():
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
