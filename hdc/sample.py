"""Random samples of up to 19 training frames of each class, whatever the batches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import torch
from torch import Tensor

from hdc.inputs import Label
from hdc.tensors import checked

KEPT = 19
"""Hypervectors stored per class: p-values in steps of 5 %; 0.6 MB at D = 250,000."""
_SEED = 0  # of the random choice
_WORD = 2**64 - 1


@dataclass(frozen=True)
class Sample:
    """The number of training frames of each class, and hypervectors of up to 19 of them.

    Read-outs that learn all frames at once do not need the hypervectors, and store none.
    """

    seen: Mapping[Label, int] = field(default_factory=dict)
    kept: Mapping[Label, Tensor] = field(default_factory=dict)
    """int64 [m, W] of each class, in the order of their places."""

    def replaced(self, words: Tensor, labels: Sequence[Label]) -> Sample:
        """A sample in which the classes of N new hypervectors [N, W] have new ones only."""
        fresh = Reservoir()
        fresh.add(words, labels)
        found = fresh.sample()
        return Sample({**self.seen, **found.seen}, {**self.kept, **found.kept})

    @classmethod
    def restored(
        cls, classes: Sequence[Label], seen: Any, words: Tensor | None, dimension: int
    ) -> Self:
        """The sample from a file: numbers of frames, and the hypervectors if there are any.

        Raises:
            ValueError: if they do not fit together.
        """
        kept = [min(count, KEPT) for count in seen]
        if min(kept) < 0 or len(kept) != len(classes):
            raise ValueError(f"seen {seen!r}")
        counts = {label: n for label, n in zip(classes, seen, strict=True) if n}
        if words is None:
            return cls(counts)
        n = sum(kept)
        checked({"sample": words}, {"sample": "int64 N W"}, N=n, D=dimension)
        parts = zip(classes, words.split(kept), strict=True)
        found = {label: part.clone() for label, part in parts if len(part)}
        return cls(counts, found)


class Reservoir:
    """Reservoir sampling of up to 19 hypervectors of each class, in any batches.

    Algorithm R (Vitter, ACM Trans. Math. Softw. 11, 37 (1985)): frame k draws one of k + 1 places,
    and is stored if that is one of the first 19. Random numbers depend only on the seed and on k,
    so the result does not depend on batches, files or machines.

    Args:
        start: sample to go on from.
        size: hypervectors to store per class, instead of 19.
    """

    def __init__(self, start: Sample | None = None, size: int = KEPT) -> None:
        start = start or Sample()
        self._size = size
        self._seen = dict(start.seen)
        self._kept = {label: list(words) for label, words in start.kept.items()}

    def add(self, words: Tensor, labels: Sequence[Label]) -> None:
        """Go on with hypervectors int64 [N, W] of N labels; the stored ones are copied."""
        chosen: dict[tuple[Label, int], int] = {}
        for i, label in enumerate(labels):
            k = self._seen.get(label, 0)
            self._seen[label] = k + 1
            place = k if k < self._size else random_place(_SEED, k)
            if place < self._size:
                chosen[label, place] = i
        for (label, place), i in chosen.items():
            kept = self._kept.setdefault(label, [])
            kept[place : place + 1] = [words[i].clone()]

    def sample(self) -> Sample:
        """The sample drawn so far."""
        kept = {label: torch.stack(rows) for label, rows in self._kept.items()}
        return Sample(dict(self._seen), kept)


def random_place(seed: int, k: int) -> int:
    """A random place from 0 to k, by SplitMix64 of the seed and k.

    Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    mixed = _mix(_mix(seed + 1) + k)
    return mixed * (k + 1) >> 64


def _mix(z: int) -> int:
    """The output of SplitMix64 for a state."""
    z = (z * 0x9E3779B97F4A7C15) & _WORD
    z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & _WORD
    z = ((z ^ z >> 27) * 0x94D049BB133111EB) & _WORD
    return z ^ z >> 31
