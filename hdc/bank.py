"""The frames of one source, read once: what models trained on subsets of them share.

A comparison trains many models on many subsets of the same frames. A :class:`Bank` holds the
frames, and computes hypervectors once for all subsets. The estimators of this library know a
:class:`Selection` of it, and take hypervectors from it instead of encoding its frames again.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.encoders import Encoder, Median, encode_with
from hdc.parameters import has_plain_parameters

_BATCH = 64  # frames that something is made of at a time


class Bank:
    """Frames, their labels and hypervectors.

    Args:
        frames: of any real type, [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.

    Example:
        >>> from hdc import HDCClassifier
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]], [[9, 99]]], dtype=torch.uint8)
        >>> bank = Bank(frames, np.array([0, 1, 0]), n_classes=2)
        >>> HDCClassifier().predict_from(bank, np.array([0, 1]), np.array([2]))
        array([0])
    """

    def __init__(self, frames: Tensor, labels: Any, n_classes: int) -> None:
        self.frames = frames
        self.labels = inputs.label_array(labels, len(frames))
        self.n_classes = n_classes
        self.dimension = frames[0].numel()
        self._made: dict[Hashable, Tensor] = {}

    def __len__(self) -> int:
        return len(self.frames)

    def each(
        self, make: Callable[[Tensor], Tensor], key: Hashable | None = None
    ) -> Tensor:
        """Results of a function of every frame, [n, H, W] → [n, …], computed once.

        Args:
            make: does not depend on which frames come together.
            key: equal keys mean equal results; by default the function itself.
        """
        key = make if key is None else key
        if key not in self._made:
            self._made[key] = self._in_batches(make)
        return self._made[key]

    def _in_batches(self, make: Callable[[Tensor], Tensor]) -> Tensor:
        parts = [make(part) for part in self.frames.split(_BATCH)]
        return torch.cat(parts)

    def words(self, encoder: Encoder | None = None, backend: str = "numpy") -> Tensor:
        """Hypervectors int64 [N, W] by an encoder, computed once unless it has learned.

        Args:
            encoder: by default the published one.
            backend: as of :func:`hdc.backends.kernels`; every one gives the same.
        """
        encoder = Median() if encoder is None else encoder

        def make(frames: Tensor) -> Tensor:
            return encode_with(encoder, frames, 0, backend)

        if encoder.learns:
            return self._in_batches(make)
        # Arrays among the parameters are not distinguished by their text.
        key: Hashable = encoder
        if has_plain_parameters(encoder):
            key = (type(encoder), repr(encoder))
        return self.each(make, key)

    def at(self, rows: np.ndarray) -> Selection:
        """Some of the frames, to train a model on or to ask it about."""
        return Selection(self, rows)


class Selection:
    """Some frames of a bank, a source of frames like any other: a slice is a tensor of them."""

    def __init__(self, bank: Bank, rows: np.ndarray) -> None:
        self.bank = bank
        self.rows = np.asarray(rows, dtype=np.int64)

    @property
    def shape(self) -> tuple[int, ...]:
        """[n, H, W] or [n, D]."""
        frame_shape = self.bank.frames.shape[1:]
        return (len(self.rows), *frame_shape)

    @property
    def dtype(self) -> torch.dtype:
        return self.bank.frames.dtype

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> Tensor:
        if isinstance(index, Tensor):
            index = index.numpy(force=True)
        return self.bank.frames[self.rows[index]]

    def part(self, start: int, stop: int) -> Selection:
        """Those from `start` to `stop`, as a selection."""
        return Selection(self.bank, self.rows[start:stop])

    def words(self, encoder: Encoder | None = None, backend: str = "numpy") -> Tensor:
        """Their hypervectors int64 [n, W]; see :meth:`Bank.words`."""
        if isinstance(encoder, Shared):
            return encoder.words_of(self, backend)
        if encoder is not None and encoder.learns:
            return encode_with(encoder, self[:], 0, backend)
        return self.bank.words(encoder, backend)[self.rows]


class Shared(Encoder):
    """An encoder that learns, once for all read-outs that are trained on the same frames.

    Args:
        base: the encoder.
        memory: of training frames, by their rows, the trained encoder and words that it made.
    """

    learns = True

    base_: Encoder

    def __init__(self, base: Encoder, memory: dict[bytes, Any]) -> None:
        self.base = base
        self.memory = memory

    def fit(self, frames: Selection) -> Shared:
        key = frames.rows.tobytes()
        if key not in self.memory:
            self.memory.clear()
            self.memory[key] = self.learned(frames), {}
        self.base_, self._words = self.memory[key]
        return self

    def dimension(self, n_pixels: int) -> int:
        return self.base_.dimension(n_pixels)

    def encode(self, frames: Tensor) -> Tensor:
        return self.base_.encode(frames)

    def words_of(self, chosen: Selection, backend: str) -> Tensor:
        """Hypervectors of some frames of the bank."""
        key = chosen.rows.tobytes()
        if key not in self._words:
            self._words[key] = self.encoded(chosen, backend)
        return self._words[key]

    def learned(self, frames: Selection) -> Encoder:
        """The encoder, trained."""
        return self.base.unlearned().fit(frames)

    def encoded(self, chosen: Selection, backend: str) -> Tensor:
        """Hypervectors of some frames by the trained encoder."""
        return encode_with(self.base_, chosen[:], 0, backend)
