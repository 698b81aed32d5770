"""Frames and labels as people have them: arrays, tensors or lists, labels of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor


class FrameSource(Protocol):
    """Frames uint8 or uint16 [N, H, W] or [N, D]: an array, a tensor, or whatever makes a batch of
    either when indexed by a slice or an index tensor."""

    @property
    def shape(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> Any: ...


def pixel_type(batch: Tensor) -> torch.dtype:
    """The dtype of a batch of frames, which has to be that of a camera."""
    if batch.dtype in (torch.uint8, torch.uint16):
        return batch.dtype
    found = str(batch.dtype)
    if batch.is_floating_point() and not batch.isfinite().all():
        found += " with NaN or infinite pixels"
    raise ValueError(f"frames: expected uint8 or uint16, found {found}")


def label_array(labels: Any, n: int) -> np.ndarray:
    """Labels as an array [n]: of their own type if they are of one, else of objects.

    Raises:
        ValueError: if there are not n of them, or one is NaN.
    """
    array = labels.numpy(force=True) if isinstance(labels, Tensor) else labels
    if not isinstance(array, np.ndarray) or array.dtype == object:
        values = [x.item() if isinstance(x, np.generic | Tensor) else x for x in array]
        array = np.fromiter(values, object, len(values))
        if len(kinds := set(map(type, values))) == 1 and kinds <= {str, int, float, bool}:
            plain = np.array(values)
            # NumPy drops null characters at the end of a text.
            array = array if plain.dtype.kind == "U" and plain.tolist() != values else plain
    if array.shape != (n,):
        raise ValueError(f"labels: expected {n} (one a frame), found shape {list(array.shape)}")
    if array.dtype.kind in "fcmMO" and (missing := array != array).any():
        first = int(missing.argmax())
        raise ValueError(f"labels[{first}]: expected a label, found {array[first]}")
    return array


def distinct(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct labels, sorted, and where each label stands among them."""
    if labels.dtype != object:
        return np.unique(labels, return_inverse=True)
    values = labels.tolist()
    try:
        found = list(dict.fromkeys(values))
    except TypeError as error:
        raise ValueError(f"labels: expected hashable labels, found an {error}") from None
    try:
        found.sort()
    except TypeError:
        found.sort(key=lambda label: (type(label).__name__, repr(label)))
    place = {label: k for k, label in enumerate(found)}
    classes = np.fromiter(found, object, len(found))
    return classes, np.array([place[label] for label in values])


def indexable(frames: Any) -> FrameSource:
    """Arrays, tensors and lazy sources as they are; a list of frames as one tensor."""
    if hasattr(frames, "shape"):
        return frames
    tensors = [as_tensor(frame) for frame in frames]
    for i, tensor in enumerate(tensors):
        if (tensor.shape, tensor.dtype) != (tensors[0].shape, tensors[0].dtype):
            raise ValueError(
                f"frames[{i}]: expected {tensors[0].dtype} {list(tensors[0].shape)} as frames[0], "
                f"found {tensor.dtype} {list(tensor.shape)}"
            )
    return torch.stack(tensors) if tensors else torch.empty(0, 1, 1, dtype=torch.uint8)


def as_tensor(frames: Any) -> Tensor:
    """Pixels as a tensor, in the same memory where torch can use it."""
    if isinstance(frames, Tensor):
        return frames
    array = np.asarray(frames)
    if array.dtype.kind not in "biuf" or array.dtype.itemsize > 8:
        raise ValueError(f"frames: expected uint8 or uint16, found {array.dtype}")
    native = array.dtype.newbyteorder("=")
    # torch has no negative strides, and warns of memory that may not be written.
    usable = array.flags.writeable and all(stride >= 0 for stride in array.strides)
    return torch.from_numpy(array.astype(native, copy=not usable))


def choose(name: str, value: str, options: Mapping[str, Any]) -> Any:
    """``options[value]``, or an error that lists the valid ones."""
    if value not in options:
        raise ValueError(f"{name}: expected one of {', '.join(options)}, found {value!r}")
    return options[value]
