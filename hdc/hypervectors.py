"""Hypervectors: encoded frames, the trained encoder that makes them, and a sample of them."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.described import describe
from hdc.parameters import Family, Part
from hdc.tensors import checked

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000
KEPT = 19
"""Hypervectors stored per class: p-values in steps of 5 %; 0.6 MB at D = 250,000."""
_WORD = 2**64 - 1


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


# Making them --------------------------------------------------------------------------------------


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


# A sample of each class ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Sample:
    """The number of training frames of each class, and hypervectors of up to 19 of them.

    Classes are rows 0 … L − 1. Read-outs that learn all frames at once do not need the
    hypervectors, and store none.
    """

    seen: Counter[int] = field(default_factory=Counter)
    kept: dict[int, Tensor] = field(default_factory=dict)
    """int64 [m, W] of each class with frames, in the order of their places; never changed."""

    def with_frames(
        self, words: Tensor, rows: Sequence[int], size: int = KEPT
    ) -> Sample:
        """A sample of hypervectors int64 [N, W] of N classes, too, in any batches.

        This is reservoir sampling by algorithm R (Vitter, ACM Trans. Math. Softw. 11, 37 (1985)):
        frame k draws one of k + 1 places, and is stored if that is one of the first `size`. Random
        numbers depend only on the seed and on k, so the result does not depend on batches, files or
        machines.
        """
        seen, chosen = self.seen.copy(), {}
        for i, row in enumerate(rows):
            k = seen[row]
            seen[row] += 1
            place = k if k < size else random_place(k)
            if place < size:
                chosen[row, place] = i
        found = {row: list(self.kept.get(row, ())) for row, _ in chosen}
        for (row, place), i in chosen.items():
            found[row][place : place + 1] = [words[i]]
        stored = {row: torch.stack(own) for row, own in found.items()}
        return Sample(seen, self.kept | stored)

    def replaced(self, words: Tensor, rows: Sequence[int]) -> Sample:
        """A sample in which the classes of N new hypervectors [N, W] have new ones only."""
        new = Sample().with_frames(words, rows)
        seen = Counter({**self.seen, **new.seen})
        return Sample(seen, {**self.kept, **new.kept})

    def arranged(self, places: Sequence[int]) -> Sample:
        """The sample in which class k becomes class places[k]."""
        seen = Counter({places[row]: n for row, n in self.seen.items()})
        return Sample(seen, {places[row]: own for row, own in self.kept.items()})

    def listed(self) -> tuple[Tensor, Tensor]:
        """The stored hypervectors int64 [M, W], class by class, and their classes int64 [M]."""
        rows = [row for row in sorted(self.kept) for _ in self.kept[row]]
        words = [self.kept[row] for row in sorted(self.kept)]
        return torch.cat(words), torch.tensor(rows)

    @classmethod
    def restored(
        cls, n_classes: int, seen: Any, tensors: Mapping[str, Tensor], dimension: int
    ) -> Self:
        """The sample from a file: numbers of frames, and the hypervectors if there are any.

        Raises:
            ValueError: if they do not fit together.
        """
        sizes = [min(count, KEPT) for count in seen]
        if min(sizes) < 0 or len(sizes) != n_classes:
            raise ValueError(f"seen {seen!r}")
        kept = {}
        if tensors:
            kinds = {"sample": "int64 N W"}
            found = checked(tensors, kinds, N=sum(sizes), D=dimension)
            parts = enumerate(found["sample"].split(sizes))
            kept = {row: part.clone() for row, part in parts if len(part)}
        return cls(Counter(dict(enumerate(seen))), kept)


def random_place(k: int) -> int:
    """A random place from 0 to k, by SplitMix64 of a fixed seed and k.

    Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    mixed = _mix(_mix(1) + k)
    return mixed * (k + 1) >> 64


def _mix(z: int) -> int:
    """The output of SplitMix64 for a state."""
    z = (z * 0x9E3779B97F4A7C15) & _WORD
    z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & _WORD
    z = ((z ^ z >> 27) * 0x94D049BB133111EB) & _WORD
    return z ^ z >> 31
