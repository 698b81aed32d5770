"""Checks of frames, labels and numbers; some errors contain words that scikit-learn expects."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from hdc.warning import warn

Label = str | int | float | bool
_LABELS = (str, int, float, bool)
_TIMES = (np.datetime64, np.timedelta64)
_CONTINUOUS = 30
"""More frames than this with fractional labels that all differ are no classes."""


_NO_FRAMES = {
    "toarray": "a sparse one; use its toarray()",
    "batch_sampler": "a loader of batches; give each batch to partial_fit",
}
"""Attribute of an object that holds no frames → what it is."""


class FrameSource(Protocol):
    """Frames [N, H, W] or [N, D]: an array, a tensor, or an object whose slices are either."""

    @property
    def shape(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> Any: ...


def indexable(frames: Any, shape: tuple[int, ...] | None = None) -> Any:
    """Frames as an object with a shape [N, ...]: a :class:`FrameSource` itself, others as arrays.

    Args:
        frames: a :class:`FrameSource`, a sequence of frames, or a data frame, whose columns are the
            pixels in its order.
        shape: shape (H, W) of a frame, if known; a single frame then becomes a batch of one.

    Raises:
        TypeError: for a sparse matrix, a loader of batches, or what is no sequence.
        ValueError: for frames of different sizes, a single row of pixels, frames of more than one
            channel, or masked pixels.
    """
    for attribute, other in _NO_FRAMES.items():
        if hasattr(frames, attribute):
            raise TypeError(f"frames: expected a dense array, found {other}")
    if hasattr(frames, "iloc") or not hasattr(frames, "shape"):
        frames = _as_array(frames)
    _check_unmasked("frames", frames)
    if isinstance(frames, Tensor):
        _check_dense("frames", frames)
    found = tuple(frames.shape)
    if found != (0,):  # an empty list
        _check_axes(found)
    if found == shape and len(shape) == 2 and shape[0] > 1:
        return tensor(frames)[None]
    return frames


def columns_of(frames: Any) -> list[str] | None:
    """Names of the columns of a data frame; None for other frames."""
    names = getattr(frames, "columns", None)
    return None if names is None else [*map(str, names)]


def check_any(frames: Any) -> None:
    """Raise ValueError for no frames."""
    if len(frames) == 0:
        raise ValueError("frames: expected at least one frame, found none")


def _check_axes(found: tuple[int, ...]) -> None:
    """Raise ValueError unless frames have the shape [N, H, W] or [N, D]."""
    wrong = ""
    if len(found) < 2:
        wrong = f"{found}; Reshape your data: of one frame, frames[None] is a batch"
    elif len(found) > 3:
        wrong = f"{found}; take one channel of each frame"
    elif 0 in found[1:]:
        wrong = f"0 feature(s) (shape={found}) while a minimum of 1 is required."
    if wrong:
        raise ValueError(f"frames: expected shape [N, H, W] or [N, D], found {wrong}")


def _as_array(frames: Any) -> np.ndarray:
    """A sequence of frames of one shape, or a data frame, as one array."""
    if hasattr(frames, "__array__"):
        return np.asarray(frames)
    if not np.iterable(frames):
        expected = "expected shape [N, H, W] or [N, D]"
        raise TypeError(f"frames: {expected}, found {frames!r}")
    frames = list(frames)
    if len({np.shape(frame) for frame in frames}) > 1:
        raise ValueError("frames: expected frames of one shape, found several")
    return np.asarray(frames)


def _check_unmasked(name: str, values: Any) -> None:
    """Raise ValueError for a masked array of numpy with masked values."""
    if np.ma.is_masked(values):
        raise ValueError(f"{name}: expected all to have a value, found masked ones")


def tensor(frames: Any) -> Tensor:
    """A batch of frames as a tensor, without a copy if torch can read the memory as it is.

    Raises:
        TypeError: for values that are not numbers.
        ValueError: for complex numbers or masked pixels.
    """
    _check_unmasked("frames", frames)
    if not isinstance(frames, Tensor):
        array = np.asarray(frames)
        if array.dtype == object:
            array = array.astype(np.float64)
        if array.dtype.kind == "c":
            raise ValueError(
                "frames: expected real pixels, found Complex data not supported"
            )
        if array.dtype.kind not in "uif":
            raise TypeError(
                f"frames: expected real or integer pixels, found dtype {array.dtype}"
            )
        if array.dtype.itemsize > 8:
            raise TypeError(
                f"frames: expected pixels of at most 64 bits, found dtype {array.dtype}; "
                "astype(np.float64)"
            )
        native = array.dtype.newbyteorder("=")
        array = array.astype(native, order="C", copy=False)
        # numpy calls an axis of length 1 contiguous whatever its stride; torch refuses negative.
        if not array.flags.writeable or min(array.strides, default=0) < 0:
            array = array.copy()
        frames = torch.from_numpy(array)
    _check_dense("frames", frames)
    return frames


def check_frames(frames: Any) -> None:
    """Raise TypeError or ValueError for all but tensors [N, H, W] or [N, D] of real pixels."""
    if not isinstance(frames, Tensor):
        found = type(frames).__name__
        raise TypeError(f"frames: expected a torch tensor, found {found}")
    _check_axes(tuple(frames.shape))
    if frames.dtype == torch.bool or frames.is_complex():
        raise TypeError(
            f"frames: expected real or integer pixels, found {frames.dtype}"
        )


def _check_dense(name: str, values: Tensor) -> None:
    """Raise TypeError for a meta or sparse tensor."""
    found = ""
    if values.is_meta:
        found = "a meta tensor, which holds none"
    elif values.layout != torch.strided:
        found = "a sparse tensor; use its to_dense()"
    if found:
        raise TypeError(f"{name}: expected plain numbers, found {found}")


def check_shape(found: Sequence[int], expected: tuple[int, ...]) -> None:
    """Check that a frame has the shape of training, or, if either is flat, as many pixels.

    Raises:
        ValueError: for another number of pixels, or an image of another shape.
    """
    found = tuple(found)
    d, n = math.prod(expected), math.prod(found)
    if n != d:
        raise ValueError(
            f"frames: expected D = {d} pixels as in training (shape {expected}), found {n}: "
            f"X has {n} features, but it is expecting {d} features as input"
        )
    if len(found) == len(expected) == 2 and found != expected:
        raise ValueError(
            f"frames: expected shape {expected} as in training, found {found}"
        )


def label_array(labels: Any, n: int, name: str = "labels") -> np.ndarray:
    """Labels [n] or [n, 1], each a str, int, float or bool, as an array [n].

    Labels keep their exact values: the array is of objects if no type of numpy can hold them.

    Raises:
        ValueError: for a wrong number of labels, another type such as dates, NaN, masked labels, or
            a set or a dictionary.
    """
    labels = _without_column(one_a_frame(name, labels, n))
    if isinstance(labels, np.ndarray) and labels.dtype.kind not in "mM":
        labels = labels.tolist()  # Python's numbers of the same value
    items = [_as_label(label, name, i) for i, label in enumerate(labels)]
    # numpy turns some integers into floats, and drops null characters at the end of a string.
    array = np.array(items)
    found = array.tolist()
    exact = found == items and [*map(type, found)] == [*map(type, items)]
    return array if exact else np.array(items, object)


def _as_label(label: Any, name: str, i: int) -> Label:
    """A number or text, of numpy or torch, too, as Python's; ValueError for other objects."""
    of_numpy = isinstance(label, np.generic) and not isinstance(label, _TIMES)
    if of_numpy or (isinstance(label, Tensor) and label.ndim == 0):
        label = label.item()
    if type(label) not in _LABELS or label != label:
        raise ValueError(
            f"{name}[{i}]: expected a str, int, float or bool, found {label!r}"
        )
    found: Label = label
    return found


def _without_column(labels: Any) -> Any:
    """Labels [n] from a column [n, 1], with a warning."""
    if not isinstance(labels, np.ndarray) or labels.ndim != 2 or labels.shape[1] != 1:
        return labels
    module = sys.modules.get("sklearn.exceptions")
    kind = getattr(module, "DataConversionWarning", UserWarning)
    warn(
        "A column-vector y was passed when a 1d array was expected; its labels are taken",
        kind,
    )
    return labels[:, 0]


def check_discrete(labels: Sequence[Label]) -> None:
    """Check that labels are classes and not a continuous quantity.

    Numbers such as depths of 0.5 mm may be labels, but not if every frame has another one.

    Raises:
        ValueError: for more than 30 fractional numbers that all differ, or for infinity alone.
    """
    n = len(labels)
    if set(labels) <= {math.inf, -math.inf}:
        raise ValueError(f"labels: expected classes, found {labels[0]!r} alone")
    if n <= _CONTINUOUS or len(set(labels)) < n:
        return
    if all(isinstance(label, float) and label % 1 for label in labels):
        raise ValueError(
            f"labels: expected classes, found {n} different numbers for {n} frames (Unknown label "
            "type: continuous); HDCRegressor predicts numbers"
        )


def one_a_frame(name: str, values: Any, n: int) -> Any:
    """Values, one for each of n frames, as an array or a list."""
    if values is None:
        raise ValueError(
            f"{name}: expected {n}, one a frame, found None: the estimator requires y to be "
            "passed, but the target y is None"
        )
    if isinstance(values, Tensor):
        _check_dense(name, values)
        if values.dtype == torch.bfloat16:  # which numpy has not
            values = values.float()
        values = values.numpy(force=True)
    _check_unmasked(name, values)
    if hasattr(values, "__array__"):
        values = np.asarray(values)
    # A text would be taken letter by letter, a set in any order, a dictionary by its keys.
    if not np.iterable(values) or isinstance(values, str | set | frozenset | Mapping):
        found = type(values).__name__
        raise ValueError(f"{name}: expected a list or an array, found a {found}")
    if not isinstance(values, np.ndarray):
        values = list(values)
    if len(values) != n:
        raise ValueError(f"{name}: expected {n}, one a frame, found {len(values)}")
    if np.iscomplexobj(values):
        raise ValueError(
            f"{name}: expected real ones, found Complex data not supported"
        )
    return values


def classes_of(labels: Iterable[Label]) -> np.ndarray:
    """The distinct labels, sorted.

    Raises:
        ValueError: for text and numbers together, which have no order, or truth values and numbers,
            since True equals 1.
    """
    labels = list(labels)
    check_one_kind(labels)
    distinct = sorted(dict.fromkeys(labels))
    return label_array(distinct, len(distinct))


def check_one_kind(labels: Iterable[Label]) -> None:
    """Raise ValueError for labels of two kinds: text, numbers or truth values."""
    kinds = {_kind_of(label): label for label in labels}
    if len(kinds) < 2:
        return
    listed = " beside ".join(repr(kinds[kind]) for kind in sorted(kinds))
    raise ValueError(
        "labels: expected all text, all numbers or all truth values, found " + listed
    )


def _kind_of(label: Label) -> str:
    if isinstance(label, str):
        return "text"
    return "truth value" if isinstance(label, bool) else "number"


def check_among(labels: Iterable[Label], classes: Iterable[Label]) -> None:
    """Raise ValueError, naming the first, for labels that are not among the classes of a model."""
    known = set(classes)
    check_one_kind([*labels, *known])
    if unknown := [label for label in labels if label not in known]:
        raise ValueError(
            f"labels: expected classes among {sorted(known)}, found {unknown[0]!r}"
        )
