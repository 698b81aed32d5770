"""What users give as frames and labels, made into what the classifier works with."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Hashable, Iterable
from typing import Any

import numpy as np
import torch
from torch import Tensor


def of_sklearn(name: str, otherwise: type) -> Any:
    """An exception or warning class of scikit-learn, or another one where it is not loaded.

    Who knows scikit-learn's name for it has imported scikit-learn; this package never does, which
    would take as long as importing torch.
    """
    return getattr(sys.modules.get("sklearn.exceptions"), name, otherwise)


# Frames -------------------------------------------------------------------------------------------


def indexable(frames: Any, shape: tuple[int, ...] | None = None) -> Any:
    """Frames with a shape [N, ...]: arrays, tensors and lazy sources as they are, others as arrays.

    Args:
        frames: anything with ``shape`` and batches ``frames[a:b]``, or a sequence of frames.
        shape: shape (H, W) of a frame, where it is known: one such frame is a batch of one.

    Raises:
        TypeError: for a sparse matrix.
        ValueError: for frames of different sizes, or a single row of pixels.
    """
    if hasattr(frames, "nnz") and hasattr(frames, "toarray"):
        raise TypeError("frames: expected a dense array, found a sparse one; use its toarray()")
    if not (hasattr(frames, "shape") and hasattr(frames, "__getitem__")):
        frames = _array_of(frames)
    if len(frames.shape) == 1 and frames.shape[0]:
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D], found {tuple(frames.shape)}; "
            "Reshape your data: of one frame, frames[None] is a batch"
        )
    if shape and len(shape) == 2 and tuple(frames.shape) == shape and shape[0] > 1:
        return tensor(frames)[None]
    return frames


def _array_of(frames: Any) -> Any:
    if hasattr(frames, "__array__"):
        return np.asarray(frames)
    frames = list(frames)
    shapes = [np.shape(frame) for frame in frames]
    for i, shape in enumerate(shapes):
        if shape != shapes[0]:
            raise ValueError(
                f"frames[{i}]: expected shape {shapes[0]} as of frames[0], found {shape}"
            )
    if frames and isinstance(frames[0], Tensor):
        return torch.stack(frames)
    return np.asarray(frames)


def tensor(frames: Any) -> Tensor:
    """A batch of frames as a tensor, without a copy where torch can read the memory as it is.

    Raises:
        TypeError: for what are no numbers.
        ValueError: for complex numbers, or frames without pixels.
    """
    if not isinstance(frames, Tensor):
        frames = torch.from_numpy(_numbers(np.asarray(frames)))
    if frames.ndim == 2 and frames.shape[1] == 0:
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D] with pixels, found 0 feature(s) "
            f"(shape={tuple(frames.shape)}) while a minimum of 1 is required."
        )
    return frames


def _numbers(array: np.ndarray) -> np.ndarray:
    if array.dtype == object:
        try:
            array = array.astype(np.float64)
        except (TypeError, ValueError) as error:
            raise type(error)(f"frames: expected real or integer pixels: {error}") from error
    if array.dtype.kind == "c":
        raise ValueError(
            f"frames: expected real or integer pixels, found dtype {array.dtype}: "
            "Complex data not supported"
        )
    if array.dtype.kind not in "uif":
        raise TypeError(f"frames: expected real or integer pixels, found dtype {array.dtype}")
    if not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="))
    if not array.flags.writeable or not array.flags.c_contiguous:
        array = array.copy()
    return array


def check_shape(found: tuple[int, ...], expected: tuple[int, ...], model: str) -> None:
    """Check the shape of a frame against that of the frames a model was trained on.

    Frames that are flattened, (D,), fit those of any shape with as many pixels.

    Raises:
        ValueError: for another number of pixels, or an image of another shape.
    """
    found = tuple(found)
    d, n = math.prod(expected), math.prod(found)
    if n != d:
        raise ValueError(
            f"frames: expected D = {d} pixels as in training (shape {expected}), found {n}: "
            f"X has {n} features, but {model} is expecting {d} features as input"
        )
    if len(found) == len(expected) == 2 and found != expected:
        raise ValueError(f"frames: expected shape {expected} as in training, found {found}")


def feature_names(frames: Any) -> np.ndarray | None:
    """The names of a data frame's columns, where all are strings, as scikit-learn keeps them."""
    if not (hasattr(frames, "columns") and hasattr(frames, "iloc")):
        return None
    names = list(frames.columns)
    return object_array(names) if all(isinstance(name, str) for name in names) else None


# Labels -------------------------------------------------------------------------------------------


def label_array(labels: Any, n: int) -> np.ndarray:
    """Labels [n] of one of numpy's types where all are of one, else as objects.

    Raises:
        ValueError: for labels of another number or of two dimensions, or one that equals nothing
            (NaN, NaT).
    """
    if labels is None:
        raise ValueError(
            f"labels: expected {n}, one a frame, found None: the classifier requires y to be "
            "passed, but the target y is None"
        )
    if isinstance(labels, Tensor):
        labels = labels.numpy(force=True)
    elif hasattr(labels, "__array__") and not isinstance(labels, np.generic):
        labels = np.asarray(labels)
    if not isinstance(labels, np.ndarray):
        labels = _array_of_labels(list(labels) if isinstance(labels, Iterable) else [labels])
    if labels.ndim == 2 and labels.shape[1] == 1:
        warnings.warn(
            "A column-vector y was passed when a 1d array was expected: "
            f"expected shape ({n},), found {labels.shape}",
            of_sklearn("DataConversionWarning", UserWarning),
            stacklevel=2,
        )
        labels = labels[:, 0]
    if labels.ndim != 1:
        raise ValueError(f"labels: expected one dimension, found shape {labels.shape}")
    if len(labels) != n:
        raise ValueError(f"labels: expected {n}, one a frame, found {len(labels)}")
    for i, label in enumerate(values(labels) if labels.dtype.kind in "fcMmO" else ()):
        if isinstance(label, float | complex | np.datetime64 | np.timedelta64) and label != label:
            found = "NaT" if isinstance(label, np.datetime64 | np.timedelta64) else "NaN"
            raise ValueError(f"labels[{i}]: found {found}")
        if not isinstance(label, Hashable):
            raise ValueError(f"labels[{i}]: expected a hashable label, found {label!r}")
    return labels


def _array_of_labels(given: list[Any]) -> np.ndarray:
    of_time = np.datetime64 | np.timedelta64
    items = [
        x.item() if isinstance(x, np.generic | Tensor) and not isinstance(x, of_time) else x
        for x in given
    ]
    kinds = {type(item) for item in items}
    if len(kinds) == 1 and kinds <= {str, int, float, bool, np.datetime64, np.timedelta64}:
        array = np.array(items)
        # numpy rounds some large integers and drops null characters at the end of a string.
        if kinds <= {float, np.datetime64, np.timedelta64} or array.tolist() == items:
            return array
    return object_array(items)


def values(labels: np.ndarray) -> list[Any]:
    """Labels as Python objects; times as numpy's, which keep the unit that Python's have not."""
    return list(labels) if labels.dtype.kind in "Mm" else labels.tolist()


def object_array(items: list[Any]) -> np.ndarray:
    """A one-dimensional array of these objects, also where they are sequences."""
    array = np.empty(len(items), object)
    array[:] = items
    return array


def classes_of(labels: np.ndarray) -> np.ndarray:
    """The distinct labels, sorted; those without a common order by type and spelling."""
    distinct = list(dict.fromkeys(values(labels)))
    try:
        distinct.sort()
    except TypeError:
        distinct.sort(key=lambda label: (type(label).__name__, repr(label)))
    return label_array(distinct, len(distinct))


def one_class(classes: np.ndarray) -> ValueError:
    """The error of training with one class only."""
    found = values(classes)[0]
    return ValueError(f"labels: expected at least two classes, found one class, {found!r}")


def check_among(labels: np.ndarray, classes: list[Hashable]) -> None:
    """Check that labels are among the classes of a model.

    Raises:
        ValueError: for the first that is not.
    """
    known = set(classes)
    for label in values(labels):
        if label not in known:
            raise ValueError(f"labels: expected classes among {classes}, found {label!r}")
