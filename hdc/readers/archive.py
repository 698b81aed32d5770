"""Arrays: an .npz with frames and labels, or an .npy whose axes are named.

Nothing is unpickled. An .npy is mapped from disk, however large it is; an .npz is read as a whole.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.files import SettingError, require
from hdc.readers.recording import Recording, Window, check_times, class_indices

IMAGE_AXES = ("height", "width")
AXES = ("label", "order", "session", "group", "value")


def open_array(
    path: Path,
    window: Window,
    axes: Sequence[str] | None,
    value_columns: Sequence[str],
    fewest_classes: int,
) -> Recording:
    """Open an .npz or .npy.

    Args:
        path: an .npz with ``frames`` (and ``labels``), or an .npy of frames alone.
        axes: name of each axis of the frames, ``height`` and ``width`` last; others may be
            ``label``, ``order``, ``session``, ``group`` and ``value``, whose numbers are places
            along the axis. Default: [N, H, W], with labels [N] in the .npz.
        value_columns: arrays [N] of the .npz that are values to learn.

    Raises:
        ValueError: the file or one of its arrays is not as described.
    """
    arrays = _load(path)
    if "frames" not in arrays:
        raise ValueError(f"{path}: expected arrays frames and labels, found no frames")
    frames, names = arrays.pop("frames"), tuple(axes) if axes is not None else ("", *IMAGE_AXES)
    fits = names[-2:] == IMAGE_AXES and len(set(names)) == len(names)
    fits = fits and (axes is None or set(names[:-2]) <= set(AXES))
    require(fits, "axes", axes, f"different names among {', '.join(AXES)}, then height and width")
    if frames.ndim != len(names) or 0 in frames.shape:
        wanted = ", ".join(axes or ("N", "H", "W"))
        raise ValueError(f"{path}[frames]: expected shape [{wanted}], found {frames.shape}")
    if frames.dtype.kind != "u" or frames.dtype.itemsize > 2:
        raise ValueError(f"{path}[frames]: expected uint8 or uint16, found {frames.dtype}")
    sides = frames.shape[:-2]
    n, places = math.prod(sides), np.indices(sides).reshape(len(sides), -1)
    if axes is not None:
        arrays = {"labels": places[names.index("label")]} if "label" in names else {}
        arrays |= dict(zip(names[:-2], places, strict=True))
    samples = {
        key: array
        for key, array in arrays.items()
        if key not in ("labels", "classes", "label", "value")
        and (key in ("order", "session") or (array.shape == (n,) and array.dtype.kind in "iufU"))
    }
    check_times(path, samples, n)
    columns = tuple(value_columns) or (("value",) if "value" in names else ())
    if wrong := [c for c in columns if c not in arrays or arrays[c].shape != (n,)]:
        raise SettingError(f"value_columns: expected arrays [{n}], found no {', '.join(wrong)}")
    if "labels" not in arrays and not columns:
        raise ValueError(f"{path}: expected arrays frames and labels, found no labels")
    classes: tuple[str, ...] = ()
    labels = None
    if "labels" in arrays:
        classes, labels = _labels(path, arrays["labels"], arrays.get("classes"), n, fewest_classes)
    native = frames.dtype.newbyteorder("=")

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        for i in index:
            frame = window.of(frames[np.unravel_index(i, sides)])
            yield np.ascontiguousarray(frame, dtype=native)

    def digest() -> str:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    return Recording(
        classes=classes,
        labels=labels,
        shape=window.shape(*frames.shape[-2:]),
        samples={"order": np.arange(n), **samples},
        each=each,
        place=lambda i: f"{path}, frame {i}",
        digest=cache(digest),
        window=window,
        values=np.stack([arrays[c].astype(float) for c in columns], 1) if columns else None,
        value_names=columns,
    )


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        if path.suffix.lower() == ".npy":
            return {"frames": np.load(path, mmap_mode="r", allow_pickle=False)}
        with np.load(path, allow_pickle=False) as archive:
            return dict(archive)
    except Exception as error:  # a damaged archive makes zipfile and numpy raise a dozen types
        found = str(error) or type(error).__name__
        raise ValueError(f"{path}: expected an intact .npz or .npy, found: {found}") from error


def _labels(
    path: Path, labels: np.ndarray, names: np.ndarray | None, n: int, fewest_classes: int
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names, and the index of each frame's [N]."""
    where = f"{path}[labels]"
    if labels.shape != (n,) or labels.dtype.kind not in "iuU":
        raise ValueError(
            f"{where}: expected integers or strings ({n},), found {labels.dtype} {labels.shape}"
        )
    if names is None:
        return class_indices([str(value) for value in labels.tolist()], where, fewest_classes)
    classes = names.tolist()
    if names.dtype.kind != "U" or names.ndim != 1 or len(set(classes)) < len(classes):
        raise ValueError(
            f"{path}[classes]: expected different strings [L], found {names.dtype} {names.shape}"
        )
    known = classes if labels.dtype.kind == "U" else range(len(classes))
    if unknown := sorted(set(labels.tolist()) - set(known)):
        raise ValueError(
            f"{where}: expected one of the {len(classes)} classes, found {unknown[0]!r}"
        )
    texts = labels.tolist() if labels.dtype.kind == "U" else [classes[i] for i in labels.tolist()]
    return class_indices(texts, where, fewest_classes, classes)
