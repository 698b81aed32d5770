"""Arrays: an .npz with frames and labels, or an .npy whose axes are named; nothing is unpickled.

An .npz is read as a whole, an .npy from disk as needed, however large it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.files import SettingError, file_digest
from hdc.readers.recording import Recording, Window, check_times, class_indices

AXES = (
    "label",
    "order",
    "session",
    "group",
    "value",
)  # an array may have, before its images


def open_array(
    path: Path,
    window: Window,
    axes: Sequence[str] | None,
    value_columns: Sequence[str],
    fewest_classes: int,
) -> Recording:
    """Open an .npz with ``frames`` [N, H, W] and ``labels`` [N], or ``value_columns`` [N], or an
    .npy of frames whose axes are named: some of :data:`AXES`, whose numbers are places along the
    axis, then ``height`` and ``width``.

    Raises:
        ValueError: the file or one of its arrays is not as described.
    """
    arrays = _load(path)
    if "frames" not in arrays:
        raise ValueError(f"{path}: expected arrays frames and labels, found no frames")
    frames = arrays.pop("frames")
    if axes is not None:
        arrays = _places(axes, frames.shape)
        value_columns = value_columns or [name for name in ("value",) if name in axes]
        frames = frames.reshape(-1, *frames.shape[-2:])
    if frames.ndim != 3 or 0 in frames.shape:
        raise ValueError(
            f"{path}[frames]: expected shape [N, H, W], found {frames.shape}"
        )
    if frames.dtype.kind != "u" or frames.dtype.itemsize > 2:
        raise ValueError(
            f"{path}[frames]: expected uint8 or uint16, found {frames.dtype}"
        )
    n, columns = len(frames), tuple(value_columns)
    if wrong := [c for c in columns if c not in arrays or arrays[c].shape != (n,)]:
        raise SettingError(
            f"value_columns: expected arrays [{n}], found no {', '.join(wrong)}"
        )
    labels = arrays.pop("labels", None)
    if labels is None and not columns:
        raise ValueError(f"{path}: expected arrays frames and labels, found no labels")
    classes: tuple[str, ...] = ()
    indices = None
    if labels is not None:
        classes, indices = _labels(
            path, labels, arrays.pop("classes", None), n, fewest_classes
        )
    samples = {
        key: array
        for key, array in arrays.items()
        if key in ("order", "session")
        or (array.shape == (n,) and array.dtype.kind in "iufU")
    }
    check_times(path, samples, n)
    native = frames.dtype.newbyteorder("=")

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        for i in index:
            yield np.ascontiguousarray(window.of(frames[i]), dtype=native)

    return Recording(
        classes=classes,
        labels=indices,
        shape=window.shape(*frames.shape[1:]),
        samples={"order": np.arange(n), **samples},
        each=each,
        place=lambda i: f"{path}, frame {i}",
        digest=cache(lambda: file_digest(path)),
        window=window,
        values=np.stack([arrays[c].astype(float) for c in columns], 1)
        if columns
        else None,
        value_names=columns,
    )


def _places(axes: Sequence[str], shape: Sequence[int]) -> dict[str, np.ndarray]:
    """Place along each axis but height and width, of every frame [N]; that along label: labels."""
    *names, height, width = axes if len(axes) > 2 else ("", "", "")
    fits = (height, width) == ("height", "width") and len(set(names)) == len(names)
    if not fits or not set(names) <= set(AXES) or len(axes) != len(shape):
        wanted = f"{len(shape)} different names among {', '.join(AXES)}, then height and width"
        raise SettingError(f"axes: expected {wanted}, found {list(axes)}")
    places = np.indices(shape[:-2]).reshape(len(names), -1)
    return {
        "labels" if k == "label" else k: p for k, p in zip(names, places, strict=True)
    }


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        if path.suffix.lower() == ".npy":
            return {"frames": np.load(path, mmap_mode="r", allow_pickle=False)}
        with np.load(path, allow_pickle=False) as archive:
            return dict(archive)
    except (
        Exception
    ) as error:  # a damaged archive makes zipfile and numpy raise a dozen types
        found = str(error) or type(error).__name__
        raise ValueError(
            f"{path}: expected an intact {path.suffix}, found: {found}"
        ) from error


def _labels(
    path: Path,
    labels: np.ndarray,
    names: np.ndarray | None,
    n: int,
    fewest_classes: int,
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names, and the index of each frame's [N]; integer labels count the ``names`` [L]."""
    if labels.shape != (n,) or labels.dtype.kind not in "iuU":
        found = f"{labels.dtype} {labels.shape}"
        raise ValueError(
            f"{path}[labels]: expected integers or strings ({n},), found {found}"
        )
    classes = None if names is None else names.astype(str).tolist()
    if classes is not None and len(set(classes)) < len(classes):
        raise ValueError(f"{path}[classes]: expected different names, found {classes}")
    by_number = dict(enumerate(classes or ()))
    texts = [str(by_number.get(label, label)) for label in labels.tolist()]
    return class_indices(texts, f"{path}[labels]", fewest_classes, classes)
