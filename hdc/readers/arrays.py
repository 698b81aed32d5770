"""Frames of an array: which array, which axis is which, and what else of the file belongs to each.

How an array was read is noted.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hdc.readers.about import Columns
from hdc.readers.axes import Frames, reading
from hdc.readers.files import Ambiguous, BadFrame, SettingError, file_digest
from hdc.readers.known import beside, check_learnt, columns_of, count
from hdc.readers.recording import Asked, Recording
from hdc.readers.store import Store
from hdc.readers.stores import load
from hdc.readers.table import columns_in
from hdc.readers.template import suggested


def open_frames(path: Path, asked: Asked) -> Recording:
    """Frames of an array, with labels or values beside it in the file, or in a table.

    Without ``asked.axes`` they are as :func:`~hdc.readers.axes.reading` says. The table is beside
    the file by default, its suffix replaced by .csv, where the file has no labels.

    Raises:
        Ambiguous: two arrays, or two orders of axes, can be meant.
        ValueError: the file or one of its arrays is not as described.
    """
    store = load(path)
    name = _frames_name(path, store, asked)
    array = store.arrays[name]
    _check_pixels(f"{path}[{name}]", array)
    arrays = beside(path, store, asked, name)
    columns, notes = _table(path, arrays, asked)
    axes = asked.axes or store.axes.get(name)
    if axes is None:
        n_rows = columns.n if columns else count(arrays, asked, array.shape)
        axes = reading(f"{path}[{name}]", array, n_rows, store.frames_last)
    where = f"{path}:/{asked.dataset}" if asked.dataset else f"{path}"

    def place(i: int) -> str:
        return f"{where}, frame {i}" if n > 1 else where

    frames = Frames(place, array, axes, asked.window)
    n = frames.n
    if columns is None:
        columns = columns_of(path, arrays, n, asked)
        if asked.fewest_classes > 0 and not (asked.values or asked.labels):
            check_learnt(path, arrays, columns, array.shape)
    else:
        _check_rows(columns, n)
    as_read = f"{path.name}[{name}] {tuple(array.shape)} as {', '.join(axes)}"
    return Recording.of(
        columns,
        frames,
        asked,
        lambda: repr((file_digest(path), asked.dataset, tuple(axes))),
        notes=(as_read, *store.notes(), *notes),
        image_shape=frames.size,
    )


def _table(
    path: Path, arrays: dict[str, Any], asked: Asked
) -> tuple[Columns | None, list[str]]:
    """The table that is asked for, or one with labels beside a file that has none; and a note on
    what lies beside it."""
    if asked.table is not None:
        return Columns.read(asked.table), []
    table = path.with_suffix(".csv")
    if "label" not in columns_in(table):
        return None, []
    if {"label", asked.labels, "values"} & arrays.keys():
        return None, [f"labels and values of the file, not of {table.name}"]
    columns = Columns.read(table)
    columns.learnt = ()
    return columns, [f"labels of {table.name}"]


def _check_rows(columns: Columns, n: int) -> None:
    """Raise a ValueError unless a table has a row per frame, in their order."""
    if columns.n != n:
        raise ValueError(
            f"{columns.where}: expected {n} rows, one per frame, found {columns.n}"
        )
    numbers = columns.columns.pop("frame", None)
    if numbers is not None and numbers.tolist() != [*range(n)]:
        raise ValueError(
            f"{columns.where}: expected rows in the order of the frames, numbered from 0 to "
            f"{n - 1} in the column frame, found {numbers[0]} to {numbers[-1]}"
        )


def _frames_name(path: Path, store: Store, asked: Asked) -> str:
    """The array that holds the frames."""
    dataset = asked.dataset
    wanted = dataset or "frames"
    if wanted in store.arrays:
        return wanted
    if wanted in store.unread:
        raise BadFrame(f"{path}[{wanted}]: {store.unread[wanted]}")
    found = [] if dataset else _stacks(store, asked.axes)
    if len(found) == 1:
        return found[0]
    if found:
        usual = ("{group}", "{label}") if "/" in "".join(found) else ()
        choices = [f"--template '{made}'" for made in suggested(found, usual)]
        choices += [f"{path}:/{name}" for name in found]
        raise Ambiguous(f"{path}: several arrays", choices)
    raise _no_frames(path, store, dataset)


def _no_frames(path: Path, store: Store, dataset: str) -> ValueError:
    """The error of a file without the array of frames: what it has."""
    arrays = store.arrays.items()
    listed = ", ".join(f"{name} {tuple(array.shape)}" for name, array in arrays)
    if dataset:
        return SettingError(f"path: {path}: expected one of {listed}; no {dataset}")
    found = "; ".join([listed or "none", *store.notes()])
    return ValueError(
        f"{path}: expected an array of frames [N, H, W] or [N, D], found {found}"
    )


def _stacks(store: Store, axes: Sequence[str] | None) -> list[str]:
    """Names of the arrays that can be frames: of three axes or more, else tables; or of as many
    axes as are asked for."""
    shapes = {k: a.shape for k, a in store.arrays.items() if a.dtype.kind in "iuf"}
    if axes is not None:
        return [name for name, shape in shapes.items() if len(shape) == len(axes)]
    stacks = [name for name, shape in shapes.items() if len(shape) > 2]
    tables = [k for k, shape in shapes.items() if len(shape) == 2 and min(shape) > 1]
    return stacks or tables


def _check_pixels(place: str, array: Any) -> None:
    kind, shape = array.dtype, tuple(array.shape)
    if kind.kind not in "uif" or kind.itemsize > 8 or 0 in shape:
        raise ValueError(
            f"{place}: expected frames of integers or floats, found {kind} {shape}"
        )
