"""Up to 19 training frames of each class, chosen at random, in any batches."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from hdc.inputs import Label

KEPT = 19
"""Hypervectors kept of a class: p-values in steps of 5 %; 0.6 MB per class at D = 250,000."""
_SEED = 0  # of the choice among training frames
_WORD = 2**64 - 1


class Sample:
    """Up to 19 hypervectors of each class, every one with the same chance, in any batches.

    A reservoir (Vitter, ACM Trans. Math. Softw. 11, 37 (1985), algorithm R): frame k takes a random
    one of k + 1 places, and is kept where that is one of the 19. Random numbers follow from the
    seed and from k alone, so batches, files and machines change nothing.

    Args:
        seed: of the random numbers, a whole number that is not negative.
    """

    def __init__(self, seed: int = _SEED) -> None:
        self.seed = seed
        self.seen: dict[Label, int] = {}  # how many of each class came by
        self._kept: dict[Label, list[Tensor]] = {}

    def choose(self, labels: Sequence[Label]) -> dict[int, tuple[Label, int]]:
        """Let frames of these labels come by: which of them take a place, and which place."""
        chosen: dict[tuple[Label, int], int] = {}
        for i, label in enumerate(labels):
            k = self.seen.get(label, 0)
            self.seen[label] = k + 1
            place = k if k < KEPT else random_place(self.seed, k)
            if place < KEPT:
                chosen[label, place] = i
        return {i: place for place, i in chosen.items()}

    def add(self, words: Tensor, labels: Sequence[Label]) -> None:
        """Let hypervectors int64 [N, W] of N labels come by; those that are kept are copied."""
        chosen = self.choose(labels)
        self.keep(chosen, (words[i].clone() for i in chosen))

    def keep(
        self, chosen: Mapping[int, tuple[Label, int]], words: Iterable[Tensor]
    ) -> None:
        """Give the chosen their places, by hypervectors int64 [W] that nobody overwrites."""
        for (label, place), row in zip(chosen.values(), words, strict=True):
            kept = self._kept.setdefault(label, [])
            kept[place : place + 1] = [row]

    def of(self, label: Label) -> Tensor:
        """The hypervectors of a class, int64 [m, W]."""
        return torch.stack(self._kept[label])

    def put(self, label: Label, words: Tensor, seen: int) -> None:
        """Keep these hypervectors, of so many, for a class."""
        self._kept[label] = list(words)
        self.seen[label] = seen

    def replace(self, words: Tensor, labels: Sequence[Label]) -> None:
        """Keep some of these of their classes, in place of what was kept."""
        fresh = Sample(self.seed)
        fresh.add(words, labels)
        self._kept = self._kept | fresh._kept
        self.seen = self.seen | fresh.seen

    def merge(self, other: Sample) -> None:
        """Make this a sample of all that came by either.

        How many places the frames of the other take is what drawing 19 of all frames would give
        (hypergeometric).
        """
        for label, n_other in other.seen.items():
            words = other.of(label)
            n = self.seen.get(label, 0)
            if n:
                mine = self.of(label)
                drawn = np.random.default_rng((self.seed, n, n_other))
                n_kept = min(KEPT, n + n_other)
                share = int(drawn.hypergeometric(n_other, n, n_kept))
                words = torch.cat(
                    (
                        _some(mine, n_kept - share, drawn),
                        _some(words, share, drawn),
                    )
                )
            self.put(label, words, n + n_other)


def _some(words: Tensor, n: int, drawn: np.random.Generator) -> Tensor:
    """Any n of the hypervectors, in their order."""
    places = np.sort(drawn.permutation(len(words))[:n])
    return words[torch.from_numpy(places)]


def random_place(seed: int, k: int) -> int:
    """A random place of frame k among k + 1, by SplitMix64 of the seed and k.

    Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    mixed = _mix(_mix(seed + 1) + k)
    return mixed * (k + 1) >> 64


def _mix(z: int) -> int:
    """One number of SplitMix64 from its state."""
    z = (z * 0x9E3779B97F4A7C15) & _WORD
    z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & _WORD
    z = ((z ^ z >> 27) * 0x94D049BB133111EB) & _WORD
    return z ^ z >> 31
