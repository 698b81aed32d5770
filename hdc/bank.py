"""Cache of the hypervectors of one data set, for models that are trained on subsets of it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs
from hdc.described import has_plain_parameters
from hdc.encoders import Encoder, Median
from hdc.hypervectors import Hypervectors

_BATCH = 64  # frames that something is made of at a time


class Bank:
    """Labelled frames, and a cache of their hypervectors, from which rows are taken.

    Args:
        frames: of any real type, [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.

    Example:
        >>> from hdc import HDCClassifier
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]], [[9, 99]]], dtype=torch.uint8)
        >>> bank = Bank(frames, np.array([0, 1, 0]), n_classes=2)
        >>> train, test = np.array([0, 1]), np.array([2])
        >>> model = HDCClassifier().fit(bank.words(train), bank.labels[train])
        >>> model.predict(bank.words(test))
        array([0])
    """

    def __init__(self, frames: Tensor, labels: Any, n_classes: int) -> None:
        self.frames = frames
        self.labels = inputs.label_array(labels, len(frames))
        self.n_classes = n_classes
        self.dimension = frames[0].numel()
        self._made: dict[Hashable, Any] = {}
        self._learned: dict[Hashable, _Learned] = {}

    def __len__(self) -> int:
        return len(self.frames)

    def each(
        self, make: Callable[[Tensor], Tensor], key: Hashable | None = None
    ) -> Tensor:
        """Results of a function for all frames, computed once.

        Args:
            make: function of frames [n, H, W] → [n, …] that treats each frame by itself.
            key: key of the cached result; by default the function itself.
        """
        key = make if key is None else key
        if key not in self._made:
            parts = [make(part) for part in self.frames.split(_BATCH)]
            self._made[key] = torch.cat(parts)
        found: Tensor = self._made[key]
        return found

    def words(
        self,
        rows: np.ndarray | None = None,
        encoder: Encoder | None = None,
        train: np.ndarray | None = None,
    ) -> Hypervectors:
        """Hypervectors of some frames, or of all.

        An encoder that learns nothing encodes each frame once. One that learns encodes a frame
        again only where other training frames give it another state.

        Args:
            rows: indices of the frames; by default all.
            encoder: untrained; by default the published one.
            train: indices of the training frames, for an encoder that learns.
        """
        encoder = Median() if encoder is None else encoder
        shape = tuple(self.frames.shape[1:])
        rows = np.arange(len(self)) if rows is None else rows
        rows = np.ascontiguousarray(rows, np.int64)
        # The text of an array does not identify it.
        key: Hashable = encoder
        if has_plain_parameters(encoder):
            key = (type(encoder), repr(encoder))
        if not encoder.learns:
            packed = self.each(encoder.encode, key)[torch.from_numpy(rows)]
        else:
            if train is None:
                raise ValueError(f"train: expected the frames that {encoder!r} learns")
            train = np.ascontiguousarray(train, np.int64)
            encoder, packed = self._by_learned(rows, encoder, train, key)
        dimension = encoder.dimension(prod(shape))
        return Hypervectors(packed, dimension, encoder, shape)

    def _by_learned(
        self, rows: np.ndarray, encoder: Encoder, train: np.ndarray, key: Hashable
    ) -> tuple[Encoder, Tensor]:
        """The trained encoder, and its words for some frames."""
        of_training = train.tobytes()
        kept = self._learned.get(key)
        if kept is None or kept.train != of_training:
            frames = self.frames[torch.from_numpy(train)]
            learned = encoder.unlearned().fit(frames)
            if kept is None or not _are_alike(kept.encoder, learned):
                kept = self._learned[key] = self._nothing_encoded(learned)
            kept.train = of_training
        new = np.unique(rows)
        new = new[~kept.is_encoded[new]]
        if len(new):
            parts = torch.from_numpy(new).split(_BATCH)
            words = [kept.encoder.encode(self.frames[part]) for part in parts]
            kept.words[torch.from_numpy(new)] = torch.cat(words)
            kept.is_encoded[new] = True
        return kept.encoder, kept.words[torch.from_numpy(rows)]

    def _nothing_encoded(self, encoder: Encoder) -> _Learned:
        width = bits.words_for(encoder.dimension(self.dimension))
        shape = len(self), width
        words = torch.empty(shape, dtype=torch.int64, device=self.frames.device)
        return _Learned(encoder, words, np.zeros(len(self), bool))


@dataclass
class _Learned:
    """A trained encoder, the training frames, and words int64 [N, W] of the frames encoded."""

    encoder: Encoder
    words: Tensor
    is_encoded: np.ndarray
    train: bytes = b""


def _are_alike(first: Encoder, second: Encoder) -> bool:
    """Whether two encoders of the same parameters have learned the same, as far as they tell."""
    ours, theirs = first.state(), second.state()
    return bool(ours) and all(torch.equal(ours[name], theirs[name]) for name in ours)
