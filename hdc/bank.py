"""Cache of the hypervectors of one data set, for models that are trained on subsets of it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
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
        self._learned: dict[Hashable, tuple[bytes, Encoder, dict[bytes, Tensor]]] = {}

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

        An encoder that learns nothing encodes each frame once. An encoder that learns keeps the
        hypervectors of its last training frames.

        Args:
            rows: indices of the frames; by default all.
            encoder: untrained; by default the published one.
            train: indices of the training frames, for an encoder that learns.
        """
        encoder = Median() if encoder is None else encoder
        rows = np.arange(len(self)) if rows is None else np.asarray(rows, np.int64)
        # The text of an array does not identify it.
        named = repr(encoder)
        key: Hashable = encoder if "<" in named else (type(encoder), named)
        if not encoder.learns:
            packed = self.each(encoder.encode, key)[torch.from_numpy(rows)]
        elif train is None:
            raise ValueError(f"train: expected the frames that {encoder!r} learns")
        else:
            encoder, made = self._of_training(encoder, np.asarray(train, np.int64), key)
            if rows.tobytes() not in made:
                parts = torch.from_numpy(rows).split(_BATCH)
                words = [encoder.encode(self.frames[part]) for part in parts]
                made[rows.tobytes()] = torch.cat(words)
            packed = made[rows.tobytes()]
        dimension = encoder.dimension(self.dimension)
        return Hypervectors(packed, dimension, encoder, tuple(self.frames.shape[1:]))

    def _of_training(
        self, encoder: Encoder, train: np.ndarray, key: Hashable
    ) -> tuple[Encoder, dict[bytes, Tensor]]:
        """The encoder that these frames train, and its words by rows, until others train it."""
        of_training = train.tobytes()
        kept = self._learned.get(key)
        if kept is None or kept[0] != of_training:
            learned = encoder.unlearned().fit(self.frames[torch.from_numpy(train)])
            kept = self._learned[key] = of_training, learned, {}
        return kept[1:]
