"""Encoded frames, which every method of a model accepts instead of the frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Hypervectors:
    """N packed hypervectors (:mod:`hdc.bits`) of one dimension.

    Example:
        >>> from hdc import HDCClassifier
        >>> frames = torch.tensor([[9, 8, 1, 0], [0, 1, 9, 8]], dtype=torch.uint8)
        >>> model = HDCClassifier().fit(frames, ["a", "b"])
        >>> words = model.encode(frames)
        >>> words.packed.tolist(), words.dimension
        ([[3], [12]], 4)
        >>> model.predict(words[1:]).tolist()
        ['b']
    """

    packed: Tensor
    """int64 [N, ⌈D/64⌉]."""
    dimension: int
    """D, bits of a hypervector."""
    encoder: Any = None
    """The trained encoder that made them, if known."""
    frame_shape: tuple[int, ...] = ()
    """(H, W) or (pixels,), the shape of an encoded frame."""

    def __len__(self) -> int:
        return len(self.packed)

    def __getitem__(self, rows: Any) -> Self:
        """Hypervectors of some rows, chosen by a slice, a mask or indices."""
        if isinstance(rows, np.ndarray):
            rows = torch.from_numpy(rows)
        if isinstance(rows, Tensor):
            rows = rows.to(self.packed.device)
        return replace(self, packed=self.packed[rows])

    def to(self, device: torch.device | str) -> Self:
        """The hypervectors on a device."""
        return replace(self, packed=self.packed.to(device))
