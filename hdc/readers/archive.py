"""Arrays: an .npz with frames and labels, or an .npy whose axes are named.

Nothing is unpickled. An .npy is mapped from disk, however large it is; an .npz is read as a whole.
"""

from __future__ import annotations

import hashlib
import math
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.files import SettingError, label, require, shown
from hdc.readers.recording import Recording, Window, check_times, class_indices

IMAGE_AXES = ("height", "width")
AXES = ("label", "order", "session", "group", "value")


def open_array(
    path: Path,
    window: Window,
    axes: Sequence[str] | None,
    value_columns: Sequence[str],
    fewest_classes: int,
    max_pixels: int,
) -> Recording:
    """Open an .npz or .npy.

    Args:
        path: an .npz with ``frames`` (and ``labels``), or an .npy of frames alone.
        axes: name of each axis of the frames, ``height`` and ``width`` last; others may be
            ``label``, ``order``, ``session``, ``group`` and ``value``, whose numbers are places
            along the axis. Default: [N, H, W], with labels [N] in the .npz.
        value_columns: arrays [N] of the .npz that are values to learn.

    Raises:
        ValueError: the file or one of its arrays is not as described, or is too large.
    """
    arrays = _load(path)
    if "frames" not in arrays:
        raise ValueError(f"{shown(path)}: expected arrays frames and labels, found no frames")
    frames = arrays.pop("frames")
    names = tuple(axes) if axes is not None else ("", *IMAGE_AXES)
    fits = names[-2:] == IMAGE_AXES and len(set(names)) == len(names)
    fits = fits and (axes is None or set(names[:-2]) <= set(AXES))
    require(fits, "axes", axes, f"different names among {', '.join(AXES)}, then height and width")
    if frames.ndim != len(names) or 0 in frames.shape:
        wanted = ", ".join(axes or ("N", "H", "W"))
        raise ValueError(f"{shown(path)}[frames]: expected shape [{wanted}], found {frames.shape}")
    if frames.dtype.kind != "u" or frames.dtype.itemsize > 2:
        raise ValueError(f"{shown(path)}[frames]: expected uint8 or uint16, found {frames.dtype}")
    height, width = frames.shape[-2:]
    if height * width > max_pixels:
        raise ValueError(
            f"{shown(path)}[frames]: expected at most {max_pixels} pixels "
            f"(max_pixels), found {width} × {height}"
        )
    shape, sides = window.shape(height, width), frames.shape[:-2]
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
    if "labels" in arrays:
        classes, labels = _labels(path, arrays["labels"], arrays.get("classes"), n, fewest_classes)
    elif columns:
        classes, labels = (), None
    else:
        raise ValueError(f"{shown(path)}: expected arrays frames and labels, found no labels")
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
        samples={"order": np.arange(n), **samples},
        each=each,
        place=lambda i: f"{shown(path)}, frame {i}",
        digest=cache(digest),
        window=window,
        values=np.stack([arrays[c].astype(float) for c in columns], 1) if columns else None,
        value_names=columns,
        size=shape,
    )


def _load(path: Path) -> dict[str, Any]:
    try:
        if path.suffix.lower() == ".npy":
            return {"frames": np.load(path, mmap_mode="r", allow_pickle=False)}
        _check_size(path)
        with np.load(path, allow_pickle=False) as archive:
            return dict(_arrays(archive))
    except Exception as error:  # a damaged archive makes zipfile and numpy raise a dozen types
        if isinstance(error, ValueError) and str(error).startswith(shown(path)):
            raise
        found = shown(error) or type(error).__name__
        raise ValueError(
            f"{shown(path)}: expected an intact .npz or .npy, found: {found}"
        ) from error


def _check_size(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        names = [member.filename for member in archive.infolist()]
        nbytes = sum(member.file_size for member in archive.infolist())
    if len(set(names)) < len(names):
        raise ValueError(f"{shown(path)}: expected each array once, found one again")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if nbytes > memory // 2:
        raise ValueError(
            f"{shown(path)}: expected arrays of at most {memory // 2} bytes, half of the memory, "
            f"found {nbytes}; use a folder of images or an .npy"
        )


def _arrays(archive: Mapping[str, np.ndarray]) -> Any:
    """All arrays but those of objects, which would have to be unpickled."""
    for key in archive:
        try:
            yield key, archive[key]
        except ValueError as error:
            if "pickle" not in str(error) or key in ("frames", "labels", "classes"):
                raise


def _labels(
    path: Path, labels: np.ndarray, names: np.ndarray | None, n: int, fewest_classes: int
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names, and the index of each frame's [N]."""
    where = f"{shown(path)}[labels]"
    if labels.shape != (n,):
        raise ValueError(f"{where}: expected shape ({n},), one a frame, found {labels.shape}")
    if labels.dtype.kind not in "iuU":
        raise ValueError(f"{where}: expected integers or strings, found {labels.dtype}")
    if names is None:
        values, index = np.unique(labels, return_inverse=True)
        texts = [label(str(value), where) for value in values.tolist()]
        return class_indices([texts[i] for i in index.tolist()], where, fewest_classes)
    place = f"{shown(path)}[classes]"
    if names.ndim != 1 or names.dtype.kind != "U":
        raise ValueError(f"{place}: expected strings [L], found {names.dtype} {names.shape}")
    classes = [label(name, place) for name in names.tolist()]
    if len(set(classes)) < len(classes):
        raise ValueError(f"{place}: expected different names, found one again")
    known = classes if labels.dtype.kind == "U" else range(len(classes))
    if unknown := sorted(set(labels.tolist()) - set(known)):
        raise ValueError(
            f"{where}: expected one of the {len(classes)} classes, found {unknown[0]!r}"
        )
    if labels.dtype.kind == "U":
        return class_indices(labels.tolist(), where, fewest_classes, classes)
    return class_indices([classes[i] for i in labels.tolist()], where, fewest_classes, classes)
