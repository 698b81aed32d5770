"""Encoded frames, which every method of a model accepts instead of the frames, and their making."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from math import prod
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.described import describe
from hdc.parameters import Family, Part

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


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


def joined(parts: Iterable[Hypervectors]) -> Hypervectors:
    """One batch of several, at least one, by the same encoder."""
    first, *others = parts
    if not others:
        return first
    packed = torch.cat([first.packed, *(part.packed for part in others)])
    return replace(first, packed=packed)


def source(frames: Any) -> Any:
    """Training frames by :func:`hdc.inputs.indexable`, or hypervectors.

    Raises:
        TypeError, ValueError: as :func:`hdc.inputs.indexable`, and for no frames.
    """
    if not isinstance(frames, Hypervectors):
        frames = inputs.indexable(frames)
    inputs.check_any(frames)
    return frames


@dataclass(frozen=True, eq=False)
class Encoding:
    """A trained encoder, the shape of its frames, and what computes."""

    encoder: Any
    frame_shape: tuple[int, ...]
    """(H, W) or (pixels,)."""
    device: str
    backend: str
    """``"numpy"`` or ``"compiled"``, as chosen at fit or load."""

    @functools.cached_property
    def dimension(self) -> int:
        """D, bits of a hypervector."""
        found: int = self.encoder.dimension(prod(self.frame_shape))
        return found

    @classmethod
    def learned(cls, encoder: Any, frames: Any, device: str, backend: str) -> Self:
        """The encoding that an untrained encoder learns, or that of given hypervectors.

        Args:
            encoder: the encoder, which is trained if it learns.
            frames: training frames or hypervectors by :func:`source`.
            device, backend: parameters of the model.

        Raises:
            ValueError: for hypervectors of another encoder, or a backend that cannot compute.
        """
        if isinstance(frames, Hypervectors):
            _check_alike(encoder, frames.encoder)
            chosen = backends.choose_backend(backend, device)
            return cls(frames.encoder, frames.frame_shape, device, chosen)
        chosen = backends.choose_backend(backend, device, prod(frames.shape))
        if encoder.learns:
            with backends.computing(chosen):
                encoder.fit(frames)
        return cls(encoder, tuple(frames.shape[1:]), device, chosen)

    def computing(self) -> AbstractContextManager[None]:
        """Context in which this thread computes by the backend."""
        return backends.computing(self.backend)

    def encoded(self, frames: Any) -> Iterator[Hypervectors]:
        """Hypervectors of frames, a chunk at a time; hypervectors are passed on unchanged.

        Raises:
            ValueError: for frames of another shape, or pixels that are not finite.
        """
        if isinstance(frames, Hypervectors):
            yield frames
            return
        for start in range(0, max(1, len(frames)), CHUNK):
            part = inputs.tensor(frames[start : start + CHUNK]).to(self.device)
            if len(part):
                inputs.check_shape(part.shape[1:], self.frame_shape)
            given = (part, start) if self.encoder.numbered else (part,)
            packed = self.encoder.encode(*given)
            yield Hypervectors(packed, self.dimension, self.encoder, self.frame_shape)

    def check_words(self, words: Hypervectors) -> None:
        """Raise ValueError for hypervectors of another encoder."""
        if words.dimension != self.dimension:
            raise ValueError(
                f"hypervectors: expected D = {self.dimension}, found {words.dimension}"
            )
        mine, theirs = self.encoder, words.encoder
        if theirs is None or theirs is mine:
            return
        _check_alike(mine, theirs)
        other = theirs.state()
        if any(not torch.equal(x, other[name]) for name, x in mine.state().items()):
            raise ValueError(
                f"hypervectors: expected an encoder {mine!r} that learned from the same frames, "
                "found one that learned from others; use this model's encode"
            )


def _check_alike(expected: Any, found: Any) -> None:
    """Raise ValueError unless an encoder is of the same class, and has the same parameters."""
    own = Family("encoder", Part, {})
    if found is None or describe(found, own) != describe(expected, own):
        raise ValueError(
            f"hypervectors: expected the encoder {expected!r}, found {found!r}"
        )
