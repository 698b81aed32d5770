"""Class prototypes: counters of ones per class, their majority, and recalibration.

Training is counting: a class is the number of its hypervectors and, for each bit, how many of them
have it set. Counts are kept bit-sliced (:mod:`hdc.planes`), L·P·D bits for classes of fewer than
2^P frames. Additions commute, so any order and any batches give the same prototypes.
"""

from __future__ import annotations

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
_RECALIBRATION, _THINNING = 1, 2
_VOTE_BITS = 24  # of a count of votes, after repeated merges
_P_STEPS = 1000


class Counters:
    """Counts of ones for L classes of D-bit hypervectors.

    `planes` int64 [L, P, W] are the bit-sliced counts, and `n` int64 [L] (CPU) the numbers of
    hypervectors.
    """

    def __init__(
        self, n_classes: int, dimension: int, device: torch.device | str = "cpu"
    ):
        self.dimension = dimension
        self.n = torch.zeros(n_classes, dtype=torch.int64)
        width = bits.words_for(dimension)
        shape = n_classes, 1, width
        self.planes = torch.zeros(shape, dtype=torch.int64, device=device)

    @classmethod
    def of(cls, counts: Tensor, n: Tensor, dimension: int) -> Self:
        """Counters that share the memory of bit-sliced counts int64 [L, P, W]."""
        found = cls(0, dimension, counts.device)
        found.planes, found.n = counts, n
        return found

    def add(self, words: Tensor, labels: Tensor) -> None:
        """Count hypervectors int64 [N, W] with class indices int64 [N] in [0, L)."""
        counted = planes.count_classes(self.planes, self.n, words, labels)
        self.planes, self.n = counted

    def placed(self, rows: Sequence[int], n_classes: int) -> Counters:
        """Counters of `n_classes` classes, in which class k of these is class rows[k]."""
        counts = self.planes.new_zeros(n_classes, *self.planes.shape[1:])
        counts[list(rows)] = self.planes
        n = torch.zeros(n_classes, dtype=torch.int64)
        n[list(rows)] = self.n
        return Counters.of(counts, n, self.dimension)

    def thinned(self, size: int, seed: int = 0) -> Counters:
        """Counters in which every class has at most `size` hypervectors.

        Each count is drawn as in a random subset of `size` hypervectors (hypergeometric),
        independently of the other bits. A prototype then correlates with frames as one of `size`
        hypervectors does, but still averages over all of them.
        """
        found = []
        for c, n in enumerate(self.n.tolist()):
            ones = self.counts([c])[0]
            if n > size:
                seeds = bits.seed_sequence(seed, (_THINNING, c))
                source = np.random.Generator(np.random.PCG64(seeds))
                counted = ones.numpy(force=True)
                drawn = source.hypergeometric(counted, n - counted, size)
                ones = torch.from_numpy(drawn).to(ones.device)
            found.append(ones)
        return self._of_counts(found, self.n.clamp(max=size))

    def _of_counts(self, counts: Sequence[Tensor], n: Tensor) -> Counters:
        """Counters from counts int64 [D] and numbers of hypervectors n, class by class."""
        n_planes = max(n.tolist(), default=0).bit_length()
        made = [bits.sliced(ones, max(1, n_planes)) for ones in counts]
        return Counters.of(torch.stack(made), n, self.dimension)

    def majority(self, ties: str = "zero") -> Tensor:
        """Prototypes int64 [L, W] by :func:`hdc.bits.majority` (paper, Eq. 1); zeros if empty."""
        return planes.majorities(self.planes, self.n, ties)

    def counts(self, rows: Sequence[int] | None = None) -> Tensor:
        """The counts of all or some classes as integers int64 [L, D]."""
        chosen = self.planes if rows is None else self.planes[list(rows)]
        return bits.numbers_of(chosen, self.dimension)


def merged(old: Counters, new: Counters, p: float) -> tuple[Counters, list[int]]:
    """Votes of old and new hypervectors of the same L classes, with the weight p of the new ones.

    A class with hypervectors on one side only takes these. p is rounded to a fraction with a
    denominator of at most 1000, and votes are integers, so that rounding decides no tie. If the
    votes of a class exceed 2^24, after some merges, they are halved until they fit.

    Returns:
        The votes, and for each class the votes of one new hypervector.

    Raises:
        ValueError: for p outside [0, 1].
    """
    check_share("p", p, "[0, 1]")
    share = Fraction(float(p)).limit_denominator(_P_STEPS)
    counts, n, of_new = [], [], []
    for c, (n_old, n_new) in enumerate(
        zip(old.n.tolist(), new.n.tolist(), strict=True)
    ):
        weight_old = (share.denominator - share.numerator) * n_new
        weight_new = share.numerator * n_old
        if n_old == 0 or n_new == 0:
            weight_old = weight_new = 1
        divisor = gcd(weight_old, weight_new)
        weight_old, weight_new = weight_old // divisor, weight_new // divisor
        votes = weight_old * old.counts([c])[0] + weight_new * new.counts([c])[0]
        n_votes = weight_old * n_old + weight_new * n_new
        halvings = max(0, n_votes.bit_length() - _VOTE_BITS)
        counts.append(votes >> halvings)
        n.append(n_votes >> halvings)
        of_new.append(weight_new >> halvings)
    return old._of_counts(counts, torch.tensor(n)), of_new


def replaced_bits(
    n_classes: int, dimension: int, p: float, seed: int, number: int = 0
) -> Tensor:
    """Random bits that are one with probability p, by class: int64 [L, W] (CPU).

    Each recalibration, by its `number`, draws other bits.
    """
    check_share("p", p, "[0, 1]")
    drawn = []
    for c in range(n_classes):
        stream = (_RECALIBRATION, c, number) if number else (_RECALIBRATION, c)
        drawn.append(bits.random_hypervector(dimension, seed, p, stream))
    return torch.stack(drawn)
