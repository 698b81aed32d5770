"""Class prototypes: counters of ones per class, their majority, and recalibration.

Training is counting: a class is the number of its hypervectors and, for each bit, how many of them
have it set. Counts are kept bit-sliced (:mod:`hdc.planes`), L·P·D bits for classes of fewer than
2^P samples. Adding and merging commute, so any order and any sharding give the same prototypes.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from fractions import Fraction
from math import gcd
from typing import Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits, planes
from hdc.parameters import check_share

# Streams of random bits from one seed.
_TIES, _RECALIBRATION, _THINNING = range(3)
_VOTE_BITS = 24  # of the votes after repeated merges
_P_STEPS = 1000


class Counters:
    """Counts of ones for L classes of D-bit hypervectors.

    `planes` int64 [L, P, W] are the counts, bit-sliced, and `n` int64 [L] (CPU) says how many
    hypervectors each class has.
    """

    def __init__(
        self, n_classes: int, dimension: int, device: torch.device | str = "cpu"
    ):
        self.dimension = dimension
        self.n = torch.zeros(n_classes, dtype=torch.int64)
        width = bits.words_for(dimension)
        self.planes = planes.zeros((n_classes, 1, width), device)

    @classmethod
    def of(cls, counts: Tensor, n: Tensor, dimension: int) -> Self:
        """Counters of bit-sliced counts int64 [L, P, W] that nobody changes."""
        found = cls(0, dimension, counts.device)
        found.planes, found.n = counts, n
        return found

    def add(self, words: Tensor, labels: Tensor) -> None:
        """Count hypervectors int64 [N, W] with class indices int64 [N] in [0, L).

        Raises:
            ValueError: if lengths or widths disagree or a label is outside [0, L).
        """
        bits.check_width(words, self.dimension)
        counted = planes.count_classes(self.planes, self.n, words, labels)
        self.planes, self.n = counted

    def merge(self, other: Counters, rows: Sequence[int] | None = None) -> None:
        """Add another set of counters, whose classes have these rows here (default: the same).

        Raises:
            ValueError: if dimensions or numbers of classes disagree.
        """
        rows = range(len(self.n)) if rows is None else rows
        if (len(rows), self.dimension) != (len(other.n), other.dimension):
            raise ValueError(
                f"merge: expected {len(rows)} classes of D = {self.dimension}, "
                f"found {len(other.n)} of D = {other.dimension}"
            )
        total = self.n.clone()
        total[list(rows)] += other.n
        self.reserve(max(total.tolist(), default=0))
        n_planes = self.planes.shape[1]  # those above are empty
        added = other.planes.to(self.planes.device)
        for c, counts in zip(rows, added, strict=True):
            summed = planes.add(self.planes[c], counts)
            self.planes[c] = summed[:n_planes]
        self.n = total

    def scaled(self, weights: Sequence[int]) -> Counters:
        """Counters in which every hypervector of class c was counted weights[c] ≥ 0 times."""
        scaled = Counters(len(self.n), self.dimension, self.device)
        scaled.n = self.n * torch.tensor(weights, dtype=torch.int64)
        scaled.reserve(max(scaled.n.tolist(), default=0))
        for c, weight in enumerate(weights):
            total = torch.zeros_like(self.planes[c, :1])
            # Horner's scheme: twice what there is, and once more.
            for bit in f"{weight:b}":
                total = torch.cat((torch.zeros_like(total[:1]), total))
                if bit == "1":
                    total = planes.add(total, self.planes[c])
            kept = min(len(total), scaled.planes.shape[1])  # the planes above are empty
            scaled.planes[c, :kept] = total[:kept]
        return scaled

    def thinned(self, size: int, seed: int = 0) -> Counters:
        """Counters of `size` samples for every class that has more.

        Each bit's count is drawn from those of a random subset of the samples (hypergeometric),
        independently of the other bits: a prototype then correlates with any frame as one of `size`
        samples does, and still averages over all samples.
        """
        thinned = Counters(len(self.n), self.dimension, self.device)
        thinned.n = self.n.clamp(max=size)
        thinned.reserve(max(thinned.n.tolist(), default=0))
        for c in range(len(self.n)):
            counts = self._thinned(c, size, seed)
            counts = counts[: thinned.planes.shape[1]]
            thinned.planes[c, : len(counts)] = counts
        return thinned

    def _thinned(self, c: int, size: int, seed: int) -> Tensor:
        n = int(self.n[c])
        if n <= size:
            return self.planes[c]
        ones = self.counts([c])[0].numpy(force=True)
        seeds = bits.seed_sequence(seed, (_THINNING, c))
        source = np.random.Generator(np.random.PCG64(seeds))
        drawn = source.hypergeometric(ones, n - ones, size)
        counts = torch.from_numpy(drawn).to(self.device)
        sliced = []
        for p in range(size.bit_length()):
            has_bit = counts >> p & 1 == 1
            sliced.append(bits.pack(has_bit))
        return torch.stack(sliced)

    def majority(
        self, ties: str = "zero", seed: int = 0, size: int | None = None
    ) -> Tensor:
        """Prototypes int64 [L, W] by :func:`hdc.bits.majority` (paper, Eq. 1); zeros of no samples.

        With ``ties="random"``, class c takes the random hypervector of (seed, c). `size` is as of
        :meth:`thinned`.
        """
        counters = self if size is None else self.thinned(size, seed)
        breaker = functools.partial(tie_breaker, self.dimension, seed)
        rows = range(len(self.n))
        return planes.majorities(counters.planes, counters.n, rows, ties, breaker)

    def counts(self, rows: Sequence[int] | None = None) -> Tensor:
        """The counts of all or some classes as integers int64 [L, D]."""
        chosen = self.planes if rows is None else self.planes[list(rows)]
        shape = len(chosen), self.dimension
        n_planes = chosen.shape[1]
        # Added up in a byte each where they fit.
        narrow = torch.uint8 if n_planes <= 8 else torch.int64
        total = torch.zeros(shape, dtype=narrow, device=self.device)
        for p in range(n_planes):
            plane = bits.unpack(chosen[:, p], self.dimension)
            total += plane.to(narrow) << p
        return total.long()

    @property
    def device(self) -> torch.device:
        return self.planes.device

    def reserve(self, n: int) -> None:
        """Make room for n hypervectors per class."""
        self.planes = planes.with_room(self.planes, n)


def tie_breaker(dimension: int, seed: int, c: int) -> Tensor:
    """The random hypervector that breaks the ties of class c, int64 [W] (CPU)."""
    return bits.random_hypervector(dimension, seed, stream=(_TIES, c))


def merged(old: Counters, new: Counters, p: float) -> tuple[Counters, list[int]]:
    """Votes of old and new hypervectors of the same L classes, the new with the share p.

    Where a class has hypervectors on one side only, those decide. p is taken as the nearest
    fraction with a denominator of at most 1000, and votes are integers: no rounding decides a tie.
    Votes of a class above 2^24, after some merges, are halved until they fit; other classes keep
    theirs. Other p are a ValueError.

    Returns:
        The votes, and how many a new hypervector of each class has.
    """
    check_share("p", p, "[0, 1]")
    share = Fraction(float(p)).limit_denominator(_P_STEPS)
    of_old, of_new = [], []
    for n_old, n_new in zip(old.n.tolist(), new.n.tolist(), strict=True):
        weight_old = (share.denominator - share.numerator) * n_new
        weight_new = share.numerator * n_old
        if n_old == 0 or n_new == 0:
            weight_old = weight_new = 1
        divisor = gcd(weight_old, weight_new)
        of_old.append(weight_old // divisor)
        of_new.append(weight_new // divisor)
    votes = old.scaled(of_old)
    votes.merge(new.scaled(of_new))
    for c, n in enumerate(votes.n.tolist()):
        halvings = n.bit_length() - _VOTE_BITS
        if halvings > 0:
            kept = votes.planes[c, halvings:].clone()
            votes.planes[c] = 0
            votes.planes[c, : len(kept)] = kept
            votes.n[c] = n >> halvings
            of_new[c] >>= halvings
    n_planes = max(1, int(votes.n.max()).bit_length())  # those above are empty
    votes.planes = votes.planes[:, :n_planes].contiguous()
    return votes, of_new


def replaced_bits(
    n_classes: int, dimension: int, p: float, seed: int, number: int = 0
) -> Tensor:
    """Bits that are one with probability p, drawn class by class: int64 [L, W] (CPU).

    Every `number` of a recalibration has bits of its own.
    """
    check_share("p", p, "[0, 1]")
    drawn = []
    for c in range(n_classes):
        stream = (_RECALIBRATION, c, number) if number else (_RECALIBRATION, c)
        drawn.append(bits.random_hypervector(dimension, seed, p, stream))
    return torch.stack(drawn)
