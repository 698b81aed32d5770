"""Frames and labels as users give them, made into tensors and arrays."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

Label = str | int | float | bool
_COMPLEX = "expected real numbers, Complex data not supported"  # scikit-learn asks for these words


def of_sklearn(name: str, otherwise: type) -> Any:
    """An exception or warning class of scikit-learn, or another one where it is not loaded.

    Importing scikit-learn takes as long as importing torch, so this package never does.
    """
    return getattr(sys.modules.get("sklearn.exceptions"), name, otherwise)


def indexable(frames: Any, shape: tuple[int, ...] | None = None) -> Any:
    """Frames with a shape [N, ...]: arrays, tensors and lazy sources as they are, others as arrays.

    Args:
        frames: anything with ``shape`` and batches ``frames[a:b]``, a sequence of frames, or a data
            frame, whose columns are taken in their order (their names are not compared).
        shape: shape (H, W) of a frame, where it is known: a single frame is then a batch of one.

    Raises:
        TypeError: for a sparse matrix.
        ValueError: for frames of different sizes, or a single row of pixels.
    """
    if hasattr(frames, "nnz") and hasattr(frames, "toarray"):
        raise TypeError("frames: expected a dense array, found a sparse one; use its toarray()")
    if hasattr(frames, "iloc") or not (hasattr(frames, "shape") and hasattr(frames, "__getitem__")):
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
        TypeError: for values that are no numbers.
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
        raise ValueError(f"frames: {_COMPLEX}, found dtype {array.dtype}")
    if array.dtype.kind not in "uif":
        raise TypeError(f"frames: expected real or integer pixels, found dtype {array.dtype}")
    if not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="))
    # numpy calls an axis of length 1 contiguous whatever its stride; torch refuses negative ones.
    negative = min(array.strides, default=0) < 0
    if negative or not (array.flags.writeable and array.flags.c_contiguous):
        array = array.copy()
    return array


def check_shape(found: Sequence[int], expected: tuple[int, ...], model: str) -> None:
    """Check the shape of a frame against that of the frames a model was trained on.

    Flattened frames, (D,), fit those of any shape with as many pixels.

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


def label_array(labels: Any, n: int) -> np.ndarray:
    """Labels [n], each a str, int, float or bool, as an array.

    Raises:
        ValueError: for a wrong number of labels, two dimensions, another type, or NaN.
    """
    labels = _one_dimension("labels", labels, n)
    items = [x.item() if isinstance(x, np.generic | Tensor) else x for x in labels]
    for i, label in enumerate(items):
        if isinstance(label, complex):
            raise ValueError(f"labels[{i}]: {_COMPLEX}, found {label!r}")
        if not isinstance(label, Label):
            raise ValueError(f"labels[{i}]: expected a str, int, float or bool, found {label!r}")
        if label != label:
            raise ValueError(f"labels[{i}]: expected a number, found NaN")
    if isinstance(labels, np.ndarray) and labels.dtype != object:
        return labels
    kinds = {type(item) for item in items}
    array = np.array(items) if len(kinds) == 1 else np.array(items, object)
    # numpy drops null characters at the end of a string.
    return array if array.tolist() == items else np.array(items, object)


def targets(values: Any, n: int) -> np.ndarray:
    """Numbers to predict, float64 [n] or [n, T].

    Raises:
        ValueError: for a wrong number of them, or values that are not finite numbers.
    """
    values = _one_dimension("targets", values, n, columns=True)
    if np.iscomplexobj(values):
        raise ValueError(f"targets: {_COMPLEX}, found {np.asarray(values).dtype}")
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"targets: expected numbers, found: {error}") from error
    if not np.isfinite(array).all():
        raise ValueError("targets: expected finite numbers, found NaN or infinity in y")
    return array


def _one_dimension(name: str, values: Any, n: int, columns: bool = False) -> Any:
    if values is None:
        raise ValueError(
            f"{name}: expected {n}, one a frame, found None: the estimator requires y to be "
            "passed, but the target y is None"
        )
    if isinstance(values, Tensor):
        values = values.numpy(force=True)
    elif hasattr(values, "__array__") and not isinstance(values, np.generic):
        values = np.asarray(values)
    elif not isinstance(values, np.ndarray):
        values = list(values) if isinstance(values, Iterable) else [values]
    whole = isinstance(values, np.ndarray) or columns
    shape: tuple[int, ...] = np.shape(values) if whole else (len(values),)
    if len(shape) == 2 and shape[1] == 1 and not columns:
        warnings.warn(
            "A column-vector y was passed when a 1d array was expected: "
            f"expected shape ({n},), found {shape}",
            of_sklearn("DataConversionWarning", UserWarning),
            stacklevel=4,
        )
        values, shape = values[:, 0], shape[:1]
    if not 1 <= len(shape) <= 1 + columns:
        raise ValueError(f"{name}: expected one dimension, found shape {shape}")
    if shape[0] != n:
        raise ValueError(f"{name}: expected {n}, one a frame, found {shape[0]}")
    return values


def classes_of(labels: Iterable[Label]) -> np.ndarray:
    """The distinct labels, sorted.

    Raises:
        ValueError: for text beside numbers, which have no order.
    """
    distinct = list(dict.fromkeys(labels))
    try:
        distinct.sort()
    except TypeError as error:
        raise ValueError("labels: expected all text or all numbers, found both") from error
    return label_array(distinct, len(distinct))


def one_class(classes: np.ndarray) -> ValueError:
    """The error of training with one class only."""
    found = classes.tolist()[0]
    return ValueError(f"labels: expected at least two classes, found one class, {found!r}")


def check_among(labels: Iterable[Label], classes: Iterable[Label]) -> None:
    """Check that labels are among the classes of a model.

    Raises:
        ValueError: for the first that is not.
    """
    known = set(classes)
    for label in labels:
        if label not in known:
            raise ValueError(f"labels: expected classes among {sorted(known)}, found {label!r}")


def check_count(name: str, value: Any) -> None:
    """Check that a parameter is an integer from 1.

    Raises:
        ValueError: if it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name}: expected an integer from 1, found {value!r}")
