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

from hdc.readers.axes import Frames, reading
from hdc.readers.files import Ambiguous, SettingError, file_digest
from hdc.readers.known import Known
from hdc.readers.recording import Recording, Window
from hdc.readers.stores import Store, load


def open_arrays(
    path: Path,
    dataset: str,
    window: Window,
    axes: Sequence[str] | None,
    labels: str | None,
    table: Path | None,
    value_columns: Sequence[str] | None,
    fewest_classes: int,
) -> Recording:
    """Open frames of an array, with labels or values beside it in the file, or in a table.

    Args:
        path: of the file.
        dataset: name of the array of frames; "" where the file has one that can be.
        window: pixels that are kept.
        axes: names among :data:`ALONG` and :data:`INSIDE`; by default one of :data:`READINGS`.
        labels: name of the array of labels [N].
        table: a CSV with a row per frame; default: beside the file, its suffix replaced by .csv,
            where the file has no labels of its own.
        value_columns: arrays [N], or columns of the table, that are values.
        fewest_classes: fewer are refused; 0: neither labels nor values are needed.

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
    for neighbour in [key for key in store.arrays if key.startswith(group)]:
        own = neighbour.removeprefix(group)
        store.arrays[own] = store.arrays.pop(neighbour)
    own_labels = labels.removeprefix(group) if labels else None
    known = Known(path, store, own_labels, table, value_columns, fewest_classes)
    if axes is None:
        where = f"{path}[{name}]"
        axes = store.axes.get(name) or reading(
            where, array, known.count, store.frames_last
        )
    frames = Frames(path, array, axes, window)
    n = len(frames)
    about = known.about(n, axes, frames.counts, array.shape)
    about["samples"] = {"order": np.arange(n), **about["samples"]}
    usual = tuple(axes[-2:]) == ("height", "width") or axes[-1] == "feature"
    special = None if usual and not dataset else (dataset, tuple(axes))
    notes = [f"{path.name}[{name}] {array.shape} as {', '.join(axes)}"]
    notes += store.notes.get(name, [])
    if "channel" in axes:
        notes.append("channels are red, green, blue")
    return Recording(
        frame_shape=window.shape(*frames.shape),
        dtype=frames.dtype,
        each=frames.each,
        place=frames.place,
        digest=cache(lambda: _digest(path, special)),
        window=window,
        notes=tuple(notes),
        image_shape=tuple(frames.shape),
        **about,
    )


def _digest(path: Path, special: object) -> str:
    own = file_digest(path)
    return own if special is None else repr((own, special))


# Which array, and which axes ----------------------------------------------------------------------


def _frames_name(path: Path, store: Store, dataset: str) -> str:
    """The array that holds the frames."""
    numbers = {k: a for k, a in store.arrays.items() if a.dtype.kind in "iuf"}
    listed = ", ".join(f"{name} {array.shape}" for name, array in store.arrays.items())
    if dataset:
        if dataset not in store.arrays:
            raise SettingError(f"path: {path}: expected one of {listed}; no {dataset}")
        return dataset
    if "frames" in store.arrays:
        return "frames"
    deep = [name for name, array in numbers.items() if len(array.shape) > 2]
    flat = [name for name, array in numbers.items() if _is_table(array.shape)]
    found = deep or flat
    if not found:
        raise ValueError(
            f"{path}: expected an array of frames [N, H, W] or [N, D], found "
            f"{listed or 'none'}{store.advice()}"
        )
    if len(found) > 1:
        raise Ambiguous(
            f"{path}: several arrays", [f"{path}:/{name}" for name in found]
        )
    return found[0]


def _is_table(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and min(shape) > 1


def _check_pixels(path: Path, name: str, array: Any) -> None:
    shape, kind = tuple(array.shape), array.dtype
    if 0 in shape or len(shape) < 2:
        raise ValueError(
            f"{path}[{name}]: expected shape [N, H, W] or [N, D], found {shape}"
        )
    if kind.kind not in "uif" or kind.itemsize > 8:
        raise ValueError(f"{path}[{name}]: expected integers or floats, found {kind}")
