"""Frames of an array: which axis is which, and what else of the file belongs to each frame.

The axis of the frames is the one that is as long as there are labels; where two are, both readings
are named. Without labels the axes are as the file's makers have them: frames first, or last in
MATLAB. How an array was read is noted.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.about import Asked, Columns
from hdc.readers.axes import ALONG, Frames, reading
from hdc.readers.files import Ambiguous, SettingError, columns_in, file_digest
from hdc.readers.known import beside, check_learnt, columns_of, count
from hdc.readers.recording import Recording, Window
from hdc.readers.stores import NUMPY, Refused, Store, load


def open_arrays(
    path: Path,
    dataset: str,
    window: Window,
    axes: Sequence[str] | None,
    asked: Asked,
) -> Recording:
    """Open frames of an array, with labels or values beside it in the file, or in a table.

    Args:
        path: of the file.
        dataset: name of the array of frames; "" where the file has one that can be.
        window: pixels that are kept.
        axes: names among :data:`~hdc.readers.axes.ALONG` and :data:`~hdc.readers.axes.INSIDE`; by
            default one of :data:`~hdc.readers.axes.READINGS`.
        asked: the table is beside the file by default, its suffix replaced by .csv, where the file
            has no labels of its own.

    Raises:
        Ambiguous: two arrays, or two orders of axes, can be meant.
        ValueError: the file or one of its arrays is not as described.
    """
    store = load(path)
    name = _frames_name(path, store, dataset)
    array = store.arrays.pop(name)
    _check_pixels(path, name, array)
    # Arrays of the same group of HDF5, or of the same struct, are known by their own names.
    group = name[: name.rfind("/") + 1]
    store.arrays = {key.removeprefix(group): a for key, a in store.arrays.items()}
    arrays = beside(store, asked.labels, group)
    table = _table(path, arrays, asked)
    columns = None if table is None else Columns.read(table)
    if axes is None:
        n = columns.n if columns else count(arrays, asked.named)
        where = f"{path}[{name}]"
        axes = store.axes.get(name) or reading(where, array, n, store.frames_last)
    frames = Frames(path, array, axes, window)
    if columns is None:
        asked, columns = _of_file(path, store, arrays, frames, axes, asked)
    else:
        _check_rows(columns, len(frames))
    read = dataset, tuple(axes)
    notes = _notes(path, name, store, axes, array.shape)
    if table is not None and asked.table is None:
        notes.append(f"labels of {table.name}")
    return Recording(
        **vars(columns.about(asked.values, asked.fewest_classes)),
        frame_shape=window.shape(*frames.shape),
        dtype=frames.dtype,
        each=frames.each,
        place=frames.place,
        digest=cache(lambda: _digest(path, *read)),
        window=window,
        notes=tuple(notes),
        image_shape=tuple(frames.shape),
    )


def _notes(
    path: Path, name: str, store: Store, axes: Sequence[str], shape: Sequence[int]
) -> list[str]:
    """How an array was read."""
    notes = [f"{path.name}[{name}] {tuple(shape)} as {', '.join(axes)}"]
    notes += store.notes.get(name, [])
    if path.suffix.lower() in NUMPY and store.unread:
        notes.append(f"left out what is no array: {', '.join(store.unread)}")
    if "channel" in axes:
        notes.append("channels are red, green, blue")
    return notes


def _of_file(
    path: Path,
    store: Store,
    arrays: dict[str, Any],
    frames: Frames,
    axes: Sequence[str],
    asked: Asked,
) -> tuple[Asked, Columns]:
    """Columns of the frames by the arrays beside them, and what is asked of these."""
    if axes[0] != "frame" or len(frames.counts) > 1:
        arrays |= _places(axes, frames.counts)
    if "value" in axes and not asked.values:
        asked = asked._replace(values=("value",))
    columns = columns_of(path, arrays, len(frames), store.frames_last)
    if asked.fewest_classes > 0 and not asked.values:
        check_learnt(path, store, columns, frames.whole)
    return asked, columns


def _table(path: Path, arrays: dict[str, Any], asked: Asked) -> Path | None:
    """The table of a file: that which is asked for, or one beside it where it has no labels."""
    if asked.table is not None or "label" in arrays or "values" in arrays:
        return asked.table
    table = path.with_suffix(".csv")
    return table if "label" in columns_in(table) else None


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


def _places(axes: Sequence[str], counts: Sequence[int]) -> dict[str, np.ndarray]:
    """Place along each axis of frames, of every frame [N]."""
    along = [axis for axis in axes if axis in ALONG]
    places = np.indices(counts).reshape(len(along), -1)
    found = dict(zip(along, places, strict=True))
    found.pop("frame", None)
    return found


def _digest(path: Path, dataset: str, axes: tuple[str, ...]) -> str:
    """That of the file, and of how it was read where that is not as usual."""
    own = file_digest(path)
    usual = axes[-2:] == ("height", "width") or axes[-1] == "feature"
    return own if usual and not dataset else repr((own, (dataset, axes)))


# Which array, and which axes ----------------------------------------------------------------------


def _frames_name(path: Path, store: Store, dataset: str) -> str:
    """The array that holds the frames."""
    listed = ", ".join(f"{name} {array.shape}" for name, array in store.arrays.items())
    if dataset:
        if dataset not in store.arrays:
            raise SettingError(f"path: {path}: expected one of {listed}; no {dataset}")
        return dataset
    if "frames" in store.arrays:
        return "frames"
    found = _stacks(store)
    if not found:
        raise ValueError(
            f"{path}: expected an array of frames [N, H, W] or [N, D], found "
            f"{listed or 'none'}{store.advice()}"
        )
    if len(found) > 1:
        choices = [f"{path}:/{name}" for name in found]
        raise Ambiguous(f"{path}: several arrays", choices)
    return found[0]


def _stacks(store: Store) -> list[str]:
    """Arrays of numbers that can be frames: those of three axes or more, or else tables."""
    shapes = {k: a.shape for k, a in store.arrays.items() if a.dtype.kind in "iuf"}
    deep = [name for name, shape in shapes.items() if len(shape) > 2]
    return deep or [name for name, shape in shapes.items() if _is_table(shape)]


def _is_table(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and min(shape) > 1


def _check_pixels(path: Path, name: str, array: Any) -> None:
    if isinstance(array, Refused):
        array[...]  # says why
    shape, kind = tuple(array.shape), array.dtype
    if 0 in shape or len(shape) < 2:
        raise ValueError(
            f"{path}[{name}]: expected shape [N, H, W] or [N, D], found {shape}"
        )
    if kind.kind not in "uif" or kind.itemsize > 8:
        raise ValueError(f"{path}[{name}]: expected integers or floats, found {kind}")
