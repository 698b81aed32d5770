"""Arrays: an .npz with frames and labels, or an .npy whose axes are named; nothing is unpickled.

An .npz is read as a whole, an .npy from disk as needed, however large it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.files import SettingError, file_digest
from hdc.readers.recording import (
    Recording,
    Window,
    check_finite,
    check_times,
    class_indices,
)

AXES = ("label", "order", "session", "group", "value")
"""Axes that an array may have, before those of its images."""


def open_array(
    path: Path,
    window: Window,
    axes: Sequence[str] | None,
    value_columns: Sequence[str],
    fewest_classes: int,
) -> Recording:
    """Open an .npz with ``frames`` [N, H, W] or [N, D], and ``labels`` [N] or values.

    Values are an array ``values`` [N] or [N, k], whose columns ``value_names`` [k] names and
    ``value_units`` [k] gives the units of, or arrays [N] that ``value_columns`` names. Of an .npy
    the axes are named: some of :data:`AXES`, whose numbers are places along the axis, then
    ``height`` and ``width``.

    Raises:
        ValueError: the file or one of its arrays is not as described.
    """
    arrays = _load(path)
    if "frames" not in arrays:
        raise ValueError(f"{path}: expected arrays frames and labels, found no frames")
    frames = arrays.pop("frames")
    if axes is not None:
        arrays = _places(axes, frames.shape)
        if "value" in axes and not value_columns:
            value_columns = ("value",)
        frames = frames.reshape(-1, *frames.shape[-2:])
    _check_frames(path, frames)
    n = len(frames)
    classes, labels = _labels(path, arrays, n, fewest_classes)
    named, units = _named_values(path, arrays, n)
    if labels is None:
        value_columns = value_columns or tuple(named)
        _check_learnt(path, value_columns, fewest_classes)
    known = arrays | named
    samples = {"order": np.arange(n), **_samples(known, n)}
    check_times(path, samples, n)
    stored = _Stored(path, frames, window)
    return Recording(
        classes=classes,
        labels=labels,
        shape=window.shape(*frames.shape[1:]),
        dtype=stored.dtype,
        samples=samples,
        each=stored.each,
        place=stored.place,
        digest=cache(lambda: file_digest(path)),
        window=window,
        values=_values(path, known, value_columns, n),
        value_names=tuple(value_columns),
        value_units=tuple(units.get(name, "") for name in value_columns),
    )


def _check_learnt(
    path: Path, value_columns: Sequence[str], fewest_classes: int
) -> None:
    """Raise a ValueError where there is nothing to learn, and something is needed."""
    if fewest_classes > 0 and not value_columns:
        raise ValueError(f"{path}: expected arrays frames and labels, found no labels")


class _Stored:
    """Frames of an array, as the machine's own kind of numbers."""

    def __init__(self, path: Path, frames: np.ndarray, window: Window) -> None:
        self._path, self._frames, self._window = path, frames, window
        self.dtype = frames.dtype.newbyteorder("=")

    def place(self, i: int) -> str:
        return f"{self._path}, frame {i}"

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        for i in index:
            kept = self._window.of(self._frames[i])
            frame = np.ascontiguousarray(kept, dtype=self.dtype)
            yield check_finite(self.place(i), frame)


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        if path.suffix.lower() == ".npy":
            return {"frames": np.load(path, mmap_mode="r", allow_pickle=False)}
        with np.load(path, allow_pickle=False) as archive:
            return dict(archive)
    except Exception as error:  # a damaged one makes zipfile and numpy raise many types
        found = str(error) or type(error).__name__
        raise ValueError(
            f"{path}: expected an intact {path.suffix}, found: {found}"
        ) from error


def _places(axes: Sequence[str], shape: Sequence[int]) -> dict[str, np.ndarray]:
    """Place along each axis but height and width, of every frame [N]; that along label: labels."""
    names = list(axes[:-2])
    fits = (
        tuple(axes[-2:]) == ("height", "width")
        and len(axes) == len(shape)
        and len(set(names)) == len(names) > 0
        and set(names) <= set(AXES)
    )
    if not fits:
        wanted = f"{len(shape)} different names among {', '.join(AXES)}, then height and width"
        raise SettingError(f"axes: expected {wanted}, found {list(axes)}")
    places = np.indices(shape[:-2]).reshape(len(names), -1)
    by_axis = dict(zip(names, places, strict=True))
    if "label" in by_axis:
        by_axis["labels"] = by_axis.pop("label")
    return by_axis


def _check_frames(path: Path, frames: np.ndarray) -> None:
    if frames.ndim not in (2, 3) or 0 in frames.shape:
        raise ValueError(
            f"{path}[frames]: expected shape [N, H, W] or [N, D], found {frames.shape}"
        )
    if frames.dtype.kind not in "uif" or frames.dtype.itemsize > 8:
        raise ValueError(
            f"{path}[frames]: expected integers or floats, found {frames.dtype}"
        )


def _named_values(
    path: Path, arrays: dict[str, np.ndarray], n: int
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns [N] of the array ``values`` and their units, by name; taken out of the arrays."""
    values = arrays.pop("values", None)
    names = arrays.pop("value_names", None)
    units = arrays.pop("value_units", None)
    if values is None:
        return {}, {}
    if values.ndim not in (1, 2) or len(values) != n:
        found = f"{values.dtype} {values.shape}"
        raise ValueError(f"{path}[values]: expected shape ({n}, k), found {found}")
    columns = values.reshape(n, -1).T
    titles = _numbered(len(columns)) if names is None else _texts(names)
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


def _numbered(n: int) -> list[str]:
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
    """What is kept of the frames: an order and a session in any case, and arrays [N]."""
    samples = {}
    for name, array in arrays.items():
        fits = array.shape == (n,) and array.dtype.kind in "iufU"
        if fits or name in ("order", "session"):
            samples[name] = array
    return samples


def _labels(
    path: Path, arrays: dict[str, np.ndarray], n: int, fewest_classes: int
) -> tuple[tuple[str, ...], np.ndarray | None]:
    """Class names, and the index of each frame's [N], taken out of the arrays; None of no labels.

    Integer labels count the names in ``classes`` [L].
    """
    labels = arrays.pop("labels", None)
    names = arrays.pop("classes", None)
    if labels is None:
        return (), None
    if labels.shape != (n,) or labels.dtype.kind not in "iuU":
        found = f"{labels.dtype} {labels.shape}"
        raise ValueError(
            f"{path}[labels]: expected integers or strings ({n},), found {found}"
        )
    classes = None if names is None else _texts(names)
    if classes is not None and len(set(classes)) < len(classes):
        raise ValueError(f"{path}[classes]: expected different names, found {classes}")
    by_number = dict(enumerate(classes or ()))
    texts = [str(by_number.get(label, label)) for label in labels.tolist()]
    return class_indices(texts, f"{path}[labels]", fewest_classes, classes)
