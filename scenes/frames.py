"""What a scene is: a labelled, ordered collection of camera frames that are made when asked for.

Every scene of this package (a simulated sensor, a measured fibre, a folder of images) has the
attributes and methods of :class:`Scene`; :class:`Frames` is the scene that lies in memory.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor


@runtime_checkable
class Scene(Protocol):
    """N labelled frames, each made on request; nothing is made before it is asked for.

    Attributes:
        classes: names of the L classes; label c means ``classes[c]``.
        labels: int64 [N], known before any frame is made.
        shape: (H, W) of one frame in pixels.
        samples: what each sample was, one array [N] a property (``order`` is its place in time,
            counted from 0; others as the scene has them: ``session``, ``temperature``, ``file``).
        origin: ``"simulated"``, ``"measured"`` or ``"recorded"``; shown wherever results are.
    """

    classes: tuple[str, ...]
    labels: np.ndarray
    shape: tuple[int, int]
    samples: Mapping[str, np.ndarray]
    origin: str

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        """Frames uint8 (or uint16) [len(indices), H, W], the same whatever else is asked for."""
        ...

    def fingerprint(self) -> str:
        """Hex digest of everything that determines the frames and labels."""
        ...


@dataclass(frozen=True)
class Frames:
    """A scene in memory.

    Args:
        images: uint8 or uint16 tensor [N, H, W].
        labels: int64 array [N] with values in [0, L).
        classes: L names.
        samples: arrays [N]; ``order`` is added when absent.
        origin: see :class:`Scene`.

    Raises:
        ValueError: if the lengths disagree, a label is outside [0, L) or a shape is wrong.
    """

    images: Tensor
    labels: np.ndarray
    classes: tuple[str, ...]
    samples: Mapping[str, np.ndarray] = field(default_factory=dict)
    origin: str = "recorded"

    def __post_init__(self) -> None:
        n = len(self.images)
        if self.images.ndim != 3:
            raise ValueError(f"images: expected shape [N, H, W], found {tuple(self.images.shape)}")
        if self.images.dtype not in (torch.uint8, torch.uint16):
            raise ValueError(f"images: expected uint8 or uint16, found {self.images.dtype}")
        if np.shape(self.labels) != (n,):
            raise ValueError(f"labels: expected {n} (one a frame), found {np.shape(self.labels)}")
        if np.asarray(self.labels).dtype.kind not in "iu":
            raise ValueError(f"labels: expected integers, found {np.asarray(self.labels).dtype}")
        bad = (self.labels < 0) | (self.labels >= len(self.classes))
        if bad.any():
            raise ValueError(
                f"labels: expected values in [0, {len(self.classes)}), "
                f"found {self.labels[bad][0]} at index {int(np.flatnonzero(bad)[0])}"
            )
        for name, values in self.samples.items():
            if len(values) != n:
                raise ValueError(f"samples[{name!r}]: expected {n} values, found {len(values)}")
        object.__setattr__(self, "samples", {"order": np.arange(n), **self.samples})

    def __len__(self) -> int:
        return len(self.images)

    @property
    def shape(self) -> tuple[int, int]:
        return (self.images.shape[1], self.images.shape[2])

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        return self.images[torch.as_tensor(np.asarray(indices), dtype=torch.int64)]

    def fingerprint(self) -> str:
        # The order is part of it: a split by time depends on it.
        order = np.ascontiguousarray(self.samples["order"], dtype="<f8")
        content = content_hash(self.images, self.labels, self.classes)
        return hashlib.sha256(content.encode() + order.tobytes()).hexdigest()


def content_hash(images: Tensor, labels: np.ndarray, classes: Sequence[str]) -> str:
    """SHA-256 over the pixels, labels and class names: equal data, equal digest."""
    digest = hashlib.sha256(repr((tuple(images.shape), str(images.dtype), list(classes))).encode())
    digest.update(np.ascontiguousarray(labels, dtype="<i8").data)
    digest.update(np.ascontiguousarray(images.numpy(force=True)).data)
    return digest.hexdigest()
