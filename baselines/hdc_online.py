"""HDC prototypes that learn from their mistakes in one pass.

AdaptHD (Imani et al., BioCAS 2019) and OnlineHD (Hernández-Cano et al., DATE 2021) add a
hypervector that was taken for another class to the prototype of its own class and subtract it from
the other. While a class has few samples, a correction outvotes them wherever they are tied, and its
prototype turns away from the features that all classes share.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier, FrameSource, choose
from hdc import bits
from hdc.encode import encode


@dataclass(kw_only=True, eq=False)
class OnlineHDCClassifier(Classifier):
    """HDC that weights a sample by whether it was recognised.

    Each frame is first classified with the prototypes of the frames before it, then counted:
    `bundle` times in its own class, and, if it was taken for another one, `correction` times more
    there and as often with its complement in the class it was taken for. The first frame of a class
    corrects nothing. The order of the frames matters.

    Args:
        bundle: how often every sample is counted; 0 learns from mistakes alone (and from the first
            sample of a class), as AdaptHD does.
        correction: how often a mistake is counted; 0 is the published classifier.
        ties: a bit with as many ones as zeros becomes ``zero`` or ``one``.
        batch_size: frames between two yields.

    Attributes:
        prototypes_: int64 [L, ⌈D/64⌉].

    Raises:
        ValueError: in ``train``, for weights below 0, or both 0.
    """

    bundle: int = 2
    correction: int = 1
    ties: str = "zero"
    batch_size: int = 256

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """One pass; yields samples_seen after each batch."""
        for name in ("bundle", "correction"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name}: expected an integer from 0, found {getattr(self, name)}")
        if self.bundle == self.correction == 0:
            raise ValueError("bundle, correction: expected one above 0, found 0 and 0")
        choose("ties", self.ties, {"zero": None, "one": None})
        targets = self.start(frames, labels)
        n_classes, dimension = len(self.classes_), self.shape_[0] * self.shape_[1]
        self._sums = torch.zeros(n_classes, dimension, dtype=torch.int32, device=self.device)
        self._known = torch.zeros(n_classes, dtype=torch.bool, device=self.device)
        self.prototypes_ = bits.pack(self._sums > 0)
        for first in range(0, len(frames), self.batch_size):
            words = encode(self.read(frames, slice(first, first + self.batch_size)))
            last = first + len(words)
            for word, row in zip(words, targets[first:last].tolist(), strict=True):
                self._learn(word, row)
            yield {"samples_seen": last}

    def scores(self, batch: Tensor) -> Tensor:
        """D − 2·(Hamming distance) to each prototype, [n, L]; −∞ for a class not seen yet."""
        return self._similarities(encode(batch))

    def state_tensors(self) -> dict[str, Tensor]:
        """prototypes [L, ⌈D/64⌉]."""
        return {"prototypes": self.prototypes_}

    def _similarities(self, words: Tensor) -> Tensor:
        similarities = self._sums.shape[1] - 2.0 * bits.hamming(words, self.prototypes_)
        return similarities.masked_fill(~self._known, -torch.inf)

    def _learn(self, word: Tensor, row: int) -> None:
        """Classify and count one hypervector int64 [W] of a class."""
        signs = 2 * bits.unpack(word, self._sums.shape[1]).to(torch.int32) - 1
        counts = {row: self.bundle if self._known[row] else max(1, self.bundle)}
        if self._known[row] and (taken := int(self._similarities(word[None]).argmax())) != row:
            counts = {taken: -self.correction, row: self.bundle + self.correction}
        for changed, times in counts.items():
            if times:
                total = self._sums[changed].add_(signs, alpha=times)
                self._known[changed] = True
                ones = total > 0 if self.ties == "zero" else total >= 0
                self.prototypes_[changed] = bits.pack(ones)
