"""The frames of one source, read once: what classifiers trained on subsets of them share.

A study trains many models on many subsets of the same frames. A :class:`Bank` holds the frames, and
computes once, when first asked, what is the same for all subsets: hypervectors, and exact inner
products of all pairs. The weights that minimise any loss with an L2 penalty are combinations of the
training frames, W = Aᵀ·X (representer theorem), so the products alone carry such a problem.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, products
from hdc.encoders import Encoder, Median, encode_with
from hdc.parameters import check_choice, has_plain_parameters
from hdc.products import Moments
from hdc.readouts.arithmetic import gram

KERNELS = ("unit", "unit_centred", "raw", "standard_global", "standardised", "bits")
"""Scalings of pixels (baselines.pixels) whose products follow from those of the grey values."""
_WHITE = {torch.uint8: 255, torch.uint16: 65535}
_BATCH = 64  # frames that something is made of at a time


class Bank:
    """Frames, their labels, hypervectors and inner products.

    Args:
        frames: uint8 or uint16 [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.
        groups: of each frame [N]: those of one are alike, such as of one session or object, and
            belong on one side of a split; None where that is not known.

    Example:
        >>> from hdc import HDCClassifier
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]], [[9, 99]]], dtype=torch.uint8)
        >>> bank = Bank(frames, np.array([0, 1, 0]), n_classes=2)
        >>> HDCClassifier().predict_from(bank, np.array([0, 1]), np.array([2]))
        array([0])
    """

    groups: np.ndarray | None = None

    def __init__(
        self,
        frames: Tensor,
        labels: Any,
        n_classes: int,
        groups: np.ndarray | None = None,
    ) -> None:
        if frames.dtype not in _WHITE:
            raise ValueError(f"frames: expected uint8 or uint16, found {frames.dtype}")
        self.frames = frames
        self.labels = inputs.label_array(labels, len(frames))
        self.n_classes = n_classes
        self.groups = groups
        self.white = _WHITE[frames.dtype]
        self.dimension = frames[0].numel()
        self._made: dict[Hashable, Tensor] = {}

    def __len__(self) -> int:
        return len(self.frames)

    # What all subsets share ----------------------------------------------------------------------

    def each(
        self, make: Callable[[Tensor], Tensor], key: Hashable | None = None
    ) -> Tensor:
        """What a function makes of every frame [n, H, W] → [n, …], computed once.

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
            backend: as of :func:`hdc.bits.kernels`; every one gives the same.
        """
        encoder = Median() if encoder is None else encoder

        def make(frames: Tensor) -> Tensor:
            return encode_with(encoder, frames, 0, backend)

        if encoder.learns:
            return self._in_batches(make)
        # Arrays among the parameters are not told apart by their text.
        key: Hashable = encoder
        if has_plain_parameters(encoder):
            key = (type(encoder), repr(encoder))
        return self.each(make, key)

    @functools.cached_property
    def greys(self) -> Tensor:
        """Products of grey values less :func:`hdc.products.constant_of` them, float64 [N, N]."""
        return products.cross_products(self._images, self._images)

    @functools.cached_property
    def bits(self) -> Tensor:
        """Products of hypervectors in ±1, D − 2·Hamming, float64 [N, N]."""
        n_pixels = len(self) * self.dimension
        backend = bits.choose_backend("auto", "cpu", n_pixels)
        words = self.words()
        found = gram(words, words, self.dimension, backend)
        return found.to(self.frames.device)

    @functools.cached_property
    def moments(self) -> Moments:
        """Moments of the grey values of each frame, less the same constant."""
        return products.moments(self._images)

    @property
    def _images(self) -> Tensor:
        """Pixels [N, D] in a type that torch can do arithmetic on."""
        flat = self.frames.flatten(1)
        if flat.dtype == torch.uint8:
            return flat
        return flat.to(torch.int32)

    # What one subset needs -----------------------------------------------------------------------

    def at(self, rows: np.ndarray) -> Selection:
        """Some of the frames, to train a model on or to ask it about."""
        return Selection(self, rows)

    def kernel(
        self, train: np.ndarray, queries: np.ndarray, pixels: str = "unit"
    ) -> tuple[Tensor, Tensor]:
        """Products of scaled frames: of the training frames [n, n], of queries with them [Q, n].

        A mean over training frames is over these; one that occurs k times counts k times.

        Args:
            train, queries: indices of frames.
            pixels: one of :data:`KERNELS`.
        """
        check_choice("pixels", pixels, KERNELS)
        rows = np.concatenate([train, queries])
        n = len(train)
        if pixels == "bits":
            part = self.bits[np.ix_(rows, train)]
        elif pixels == "standardised":
            part = self._standardised(rows, train)
        else:
            part = self._scaled(rows, train, pixels)
        return part[:n], part[n:]

    def centred(
        self, train: np.ndarray, queries: np.ndarray, pixels: str = "unit"
    ) -> tuple[Tensor, Tensor]:
        """:meth:`kernel` of scaled frames less the mean scaled training frame."""
        if pixels in ("raw", "unit", "unit_centred"):
            # The offset cancels: the small integers do without it, and lose nothing to it.
            scale = 1.0 if pixels == "raw" else 1 / self.white
            square = scale**2
            inside = square * self.greys[np.ix_(train, train)]
            across = square * self.greys[np.ix_(queries, train)]
        else:
            inside, across = self.kernel(train, queries, pixels)
        means = inside.mean(0)
        mean = inside.mean()
        own = across.mean(1, keepdim=True)
        centred_inside = inside - means - means[:, None] + mean
        centred_across = across - means - own + mean
        return centred_inside, centred_across

    def _standardised(self, rows: np.ndarray, columns: np.ndarray) -> Tensor:
        greys = self.greys[np.ix_(rows, columns)]
        ours = self.moments.of(rows)
        theirs = self.moments.of(columns)
        return standardised(greys, ours, theirs, self.dimension)

    def _scaled(self, rows: np.ndarray, train: np.ndarray, pixels: str) -> Tensor:
        """Products of scale·(x − offset), the same two numbers for all pixels."""
        ours = self.moments.of(rows)
        theirs = self.moments.of(train)
        mean = float(theirs.first.mean()) / self.dimension
        centred = pixels in ("unit_centred", "standard_global")
        offset = mean if centred else -products.constant_of(self.frames)
        scale = 1.0 if pixels == "raw" else 1 / self.white
        if pixels == "standard_global":
            square = float(theirs.second.mean()) / self.dimension
            scale = (square - mean**2) ** -0.5
        shift = offset * (ours.first[:, None] + theirs.first)
        constant = offset**2 * self.dimension
        greys = self.greys[np.ix_(rows, train)]
        return scale**2 * (greys - shift + constant)


class Selection:
    """Some frames of a bank, a source of frames like any other: a slice is a tensor of them.

    The estimators of this library know it, and take hypervectors from the bank instead of encoding
    its frames again.
    """

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
        """What the trained encoder makes of some frames."""
        return encode_with(self.base_, chosen[:], 0, backend)


def standardised(
    greys: Tensor, rows: Moments, columns: Moments, dimension: int
) -> Tensor:
    """Products of standardised frames [n, m] from those of their greys and the moments of both."""
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
