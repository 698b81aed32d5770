"""A bank of 8- or 16-bit frames: their hypervectors, and exact inner products of all pairs.

The weights that minimise any loss with an L2 penalty are combinations of the training frames,
W = Aᵀ·X (representer theorem), so the products alone carry such a problem: they are computed once
for all subsets of the frames.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines import products
from baselines.base import FRAME_TYPES
from baselines.products import Moments
from baselines.smoothing import smoothed
from hdc import inputs
from hdc.encoders import Encoder
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_choice

_BATCH = 64  # frames that something is made of at a time
KERNELS = ("unit", "raw", "standardised")
"""Scalings of pixels (baselines.pixels) whose products follow from products of grey values."""


class Bank:
    """Frames, their labels, hypervectors and inner products; subsets of them train models.

    Args:
        frames: uint8 or uint16 [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.
        groups: of each frame [N]. Frames of one group, such as a session or an object, are alike
            and belong on one side of a split. None where groups are not known.

    Raises:
        ValueError: frames of another type.
    """

    def __init__(
        self,
        frames: Tensor,
        labels: Any,
        n_classes: int,
        groups: np.ndarray | None = None,
    ) -> None:
        if frames.dtype not in FRAME_TYPES:
            raise ValueError(f"frames: expected uint8 or uint16, found {frames.dtype}")
        self.frames = frames
        self.labels = inputs.label_array(labels, len(frames))
        self.n_classes = n_classes
        self.groups = groups
        self.dimension = frames[0].numel()
        self.white = FRAME_TYPES[frames.dtype]
        self._smoothed: dict[int, Bank] = {}
        self._made: dict[Hashable, Tensor] = {}
        self._learned: dict[Hashable, tuple[bytes, Encoder, dict[bytes, Tensor]]] = {}

    def __len__(self) -> int:
        return len(self.frames)

    def groups_of(self, rows: np.ndarray) -> np.ndarray | None:
        """Groups [n] of some of the frames."""
        return None if self.groups is None else self.groups[rows]

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
        return self._made[key]

    def words(
        self, rows: np.ndarray, encoder: Encoder, train: np.ndarray
    ) -> Hypervectors:
        """Hypervectors of some frames.

        An encoder that learns nothing encodes each frame once. An encoder that learns keeps the
        hypervectors of its last training frames.

        Args:
            rows: indices of the frames.
            encoder: untrained.
            train: indices of the training frames, for an encoder that learns.
        """
        chosen = torch.from_numpy(np.asarray(rows, np.int64))
        # The text of an array does not identify it.
        named = repr(encoder)
        key: Hashable = encoder if "<" in named else (type(encoder), named)
        if encoder.learns:
            encoder, made = self._of_training(encoder, np.asarray(train, np.int64), key)
            of_rows = chosen.numpy().tobytes()
            if of_rows not in made:
                parts = [self.frames[part] for part in chosen.split(_BATCH)]
                made[of_rows] = torch.cat([encoder.encode(part) for part in parts])
            packed = made[of_rows]
        else:
            packed = self.each(encoder.encode, key)[chosen]
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

    def smoothed(self, deviation: int) -> Bank:
        """The bank of the smoothed frames (:mod:`.smoothing`), made once; this bank for 0."""
        if deviation == 0:
            return self
        if deviation not in self._smoothed:
            images = self.frames.reshape(len(self), -1, self.frames.shape[-1])
            frames = smoothed(images, deviation).reshape(self.frames.shape)
            self._smoothed[deviation] = Bank(
                frames, self.labels, self.n_classes, self.groups
            )
        return self._smoothed[deviation]

    @functools.cached_property
    def greys(self) -> Tensor:
        """Products of grey values minus :func:`.products.constant_of` them, float64 [N, N]."""
        flat = self.frames.flatten(1)
        return products.cross_products(flat, flat)

    def at(self, rows: np.ndarray) -> Rows:
        """Some of the frames, to train or to test a model."""
        return Rows(self, np.asarray(rows, dtype=np.int64))

    @functools.cached_property
    def moments(self) -> Moments:
        """Moments of the grey values of each frame, minus the same constant."""
        return products.moments(self.frames.flatten(1))

    def centred(
        self, train: np.ndarray, queries: np.ndarray, pixels: str = "unit"
    ) -> tuple[Tensor, Tensor]:
        """Products of scaled frames minus the mean scaled training frame: of the training frames
        [n, n], of queries with them [Q, n].

        The mean is over the training frames; one that occurs k times counts k times.

        Args:
            train, queries: indices of frames, n and Q.
            pixels: one of :data:`KERNELS`; others raise a ValueError.
        """
        check_choice("pixels", pixels, KERNELS)
        inside = self._products(train, train, pixels)
        across = self._products(queries, train, pixels)
        means = inside.mean(0)
        mean = inside.mean()
        own = across.mean(1, keepdim=True)
        centred_inside = inside - means - means[:, None] + mean
        centred_across = across - means - own + mean
        return centred_inside, centred_across

    def _products(self, rows: np.ndarray, columns: np.ndarray, pixels: str) -> Tensor:
        """Products of scaled frames, up to an offset of all pixels, which centring cancels."""
        greys = self.greys[np.ix_(rows, columns)]
        if pixels == "standardised":
            ours, theirs = self.moments.of(rows), self.moments.of(columns)
            return standardised(greys, ours, theirs, self.dimension)
        scale = 1.0 if pixels == "raw" else 1 / self.white
        return scale**2 * greys


@dataclass(frozen=True)
class Rows:
    """Some frames of a bank, as a source of frames; a slice is a tensor."""

    bank: Bank
    rows: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """[n, H, W] or [n, D]."""
        return (len(self.rows), *self.bank.frames.shape[1:])

    @property
    def dtype(self) -> torch.dtype:
        return self.bank.frames.dtype

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> Tensor:
        if isinstance(index, Tensor):
            index = index.numpy(force=True)
        return self.bank.frames[self.rows[index]]


def standardised(
    greys: Tensor, rows: Moments, columns: Moments, dimension: int
) -> Tensor:
    """Products of standardised frames [n, m] from products of grey values and both moments."""
    across = torch.outer(rows.first, columns.first) / dimension
    ours = deviations(rows, dimension)
    theirs = deviations(columns, dimension)
    lengths = torch.outer(ours, theirs)
    return (greys - across) / lengths


def deviations(moments: Moments, dimension: int) -> Tensor:
    """Standard deviation of the pixels of each frame; 1 for a constant frame."""
    variance = moments.second / dimension - (moments.first / dimension) ** 2
    # The least variance of a frame of whole numbers that is not constant is about 1/D.
    varies = variance > 0.1 / dimension
    return torch.where(varies, variance, 1.0).sqrt()


def squared_lengths(moments: Moments, dimension: int) -> Tensor:
    """Squared lengths of standardised frames [n]: D, and 0 of a constant frame."""
    variance = moments.second - moments.first**2 / dimension
    return variance / deviations(moments, dimension) ** 2
