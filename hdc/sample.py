"""Random samples of up to 19 training frames of each class, whatever the batches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import torch
from torch import Tensor

from hdc.tensors import checked

KEPT = 19
"""Hypervectors stored per class: p-values in steps of 5 %; 0.6 MB at D = 250,000."""
_SEED = 0  # of the random choice
_WORD = 2**64 - 1


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
            place = k if k < size else random_place(_SEED, k)
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
