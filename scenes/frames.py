"""A scene: labelled camera frames in an order of time, each made or read when asked for.

Every scene of this package (a simulated sensor, a fibre, a recording) has the attributes and
methods of :class:`Scene`; :class:`Frames` is a scene in memory.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from hdc.parameters import is_number
from scenes.validate import require

Indices = Sequence[int] | np.ndarray | Tensor
"""Numbers of samples, [k]."""


@runtime_checkable
class Scene(Protocol):
    """N labelled frames, each made or read on request.

    Attributes:
        classes: names of the L classes; label c means ``classes[c]``.
        labels: int64 [N], known before any frame is made.
        shape: (H, W) of one frame in pixels.
        samples: properties of the samples, one array [N] each: ``order`` is the place in time,
            counted from 0; others are ``session``, ``group``, ``temperature``, ``depth``.
        origin: ``"simulated"``; ``"computed"`` from measured matrices; ``"measured"`` by a camera
            of others and public; or ``"recorded"`` by the user. Shown wherever results are.

    Some have more: ``values`` float64 [N, k], continuous quantities beside the label, with
    ``value_names`` and ``units`` [k]; ``cacheable = False`` where a licence forbids to store frames
    elsewhere; ``unknown``, a scene of frames that belong to none of the classes and never train.
    """

    classes: tuple[str, ...]
    labels: np.ndarray
    shape: tuple[int, int]
    samples: Mapping[str, np.ndarray]
    origin: str

    def frames(self, indices: Indices) -> Tensor:
        """Frames uint8 (or uint16) [len(indices), H, W], the same in any batch and order."""
        ...

    def fingerprint(self) -> str:
        """Hex digest of everything that determines the frames and labels."""
        ...


@dataclass(frozen=True)
class Frames:
    """A scene in memory, images uint8 or uint16 [N, H, W]; others as :class:`Scene` has them.

    ``order`` is added to ``samples`` when absent.
    """

    images: Tensor
    labels: np.ndarray
    classes: tuple[str, ...]
    samples: Mapping[str, np.ndarray] = field(default_factory=dict)
    origin: str = "recorded"

    def __post_init__(self) -> None:
        samples = {"order": np.arange(len(self.images)), **self.samples}
        object.__setattr__(self, "samples", samples)  # the dataclass is frozen

    def __len__(self) -> int:
        return len(self.images)

    @property
    def shape(self) -> tuple[int, int]:
        return (self.images.shape[1], self.images.shape[2])

    def frames(self, indices: Indices) -> Tensor:
        rows = torch.as_tensor(np.asarray(indices), dtype=torch.int64)
        return self.images[rows]

    def fingerprint(self) -> str:
        shape = tuple(self.images.shape)
        dtype = str(self.images.dtype)
        kind = repr((shape, dtype, list(self.classes)))
        content = hashlib.sha256(kind.encode())
        content.update(np.ascontiguousarray(self.labels, dtype="<i8").data)
        images = self.images.numpy(force=True)
        content.update(np.ascontiguousarray(images).data)
        # The order is part of it: a split by time depends on it.
        order = np.ascontiguousarray(self.samples["order"], dtype="<f8")
        whole = content.hexdigest().encode() + order.tobytes()
        return hashlib.sha256(whole).hexdigest()


def level_classes(
    values: np.ndarray,
    edges: Sequence[float],
    unit: str,
    key: str = "scene.levels.edges",
    scale: float = 1.0,
) -> tuple[tuple[str, ...], np.ndarray]:
    """Classes of a continuous value: names [L], and the index of each value's [N].

    Args:
        values: float [N].
        edges: upper ends of the L classes, increasing; values above all get the index L.
        unit: of the names, in which an edge is shown after multiplication by ``scale``.
        key: of the edges in the configuration, for errors.

    Raises:
        ValueError: the edges are not two or more increasing numbers.
    """
    expected = "two or more increasing numbers"
    numbers = isinstance(edges, Sequence) and all(map(is_number, edges))
    require(numbers and len(edges) >= 2, key, edges, expected)
    increasing = bool((np.diff(edges) > 0).all())
    require(increasing, key, edges, expected)
    texts = [f"{edge * scale:g}" for edge in edges]
    names = [f"≤ {texts[0]} {unit}"]
    names += [f"{low}–{high} {unit}" for low, high in pairwise(texts)]
    labels = np.searchsorted(np.asarray(edges, float), values)
    return tuple(names), labels


def row_numbers(indices: Indices, n: int) -> np.ndarray:
    """Indices as int64 [k]; an IndexError for one outside [0, n)."""
    index = np.asarray(indices, dtype=np.int64).reshape(-1)
    outside = (index < 0) | (index >= n)
    if outside.any():
        raise IndexError(f"indices: expected values in [0, {n}), found {index}")
    return index
