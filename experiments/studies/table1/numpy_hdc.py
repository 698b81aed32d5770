"""HDC as one writes it with NumPy alone, as the paper's may have been."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from torch import Tensor


class NumpyHDC:
    """Thresholds at the median by ``numpy.median``, and bitwise majority.

    A pixel that equals the median of its frame is 0, and a bit of which as many samples are 1
    as are 0 is 0.
    """

    revision: ClassVar[int] = 1

    def train(self, frames: Tensor, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Learn from frames uint8 [N, H, W]; yields once."""
        ones = _bits(frames)
        self.classes_ = np.unique(labels)
        self.prototypes_ = np.stack(
            [_majority(ones[labels == c]) for c in self.classes_]
        )
        yield {"samples_seen": len(frames)}

    def predict(self, frames: Tensor) -> np.ndarray:
        """Labels [Q] of the nearest prototypes."""
        labels = []
        for bits in _bits(frames):
            differing = np.count_nonzero(self.prototypes_ != bits, axis=1)
            labels.append(self.classes_[differing.argmin()])
        return np.array(labels)


def _bits(frames: Tensor) -> np.ndarray:
    """Pixels above the median of their frame, bool [N, D]."""
    pixels = frames.flatten(1).numpy()
    ones = np.empty(pixels.shape, np.bool_)
    for frame, row in zip(pixels, ones, strict=True):
        np.greater(frame, np.median(frame), out=row)
    return ones


def _majority(ones: np.ndarray) -> np.ndarray:
    """Bits that more than half of the samples [n, D] have."""
    counts = np.zeros(ones.shape[1], np.uint16)
    for row in ones:
        np.add(counts, row, out=counts)
    return counts > len(ones) / 2
