"""Nearest integer prototype: the counts themselves, compared by the cosine."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from hdc import bits
from hdc.bits import dot
from hdc.hypervectors import Hypervectors
from hdc.prototypes import Counters
from hdc.readouts.base import HeldOut
from hdc.readouts.majority import Counted, Counting, smallest


class Counts(Counting):
    """Nearest class by the cosine between 2c − n, for counts c of n frames, and a bipolar query.

    Args:
        ties, class_weight, random_state: as in :class:`hdc.readouts.Majority`. Ties and the seed
            affect only the binary prototypes, and so distances and ``is_known``. With
            ``class_weight="balanced"``, a larger class is compared as a random subset of the size
            of the smallest class would be on average.
    """

    methods = ("merge",)  # counts have no bits to replace
    needs = ("planes",)

    def scores(self, state: Counted, words: Hypervectors) -> Tensor:
        """The cosines, float64 [Q, L]."""
        found = cosines(state.counters(), words.packed, self._thinned_to(state))
        found /= math.sqrt(state.dimension)
        found[:, (state.n == 0).to(found.device)] = -torch.inf
        return found

    def _thinned_to(self, state: Counted) -> int | None:
        """Size of the smallest class, to which larger ones are scaled; None if they are not."""
        if self.class_weight is not None and not state.recalibrated:
            return smallest(state.n)
        return None

    def held_out(
        self, state: Counted, words: Hypervectors | None, rows: Tensor
    ) -> HeldOut | None:
        """The cosines, of which the one to the frame's own class is computed without the frame.

        None after a recalibration, since the state does not hold the number of votes of a frame.
        """
        if state.recalibrated:
            return None
        assert words is not None
        scores = self.scores(state, words).cpu()
        size = self._thinned_to(state)
        own = cosines_without(state.counters(), words.packed, rows, size)
        places = torch.arange(len(rows))
        scores[places, rows] = own / math.sqrt(state.dimension)
        return HeldOut(scores, rows)


def cosines(counters: Counters, words: Tensor, size: int | None = None) -> Tensor:
    """√D times the cosine of queries int64 [Q, W] and 2c − n: float64 [Q, L].

    A class of more than `size` hypervectors is compared as a random subset of this size would be on
    average.

    Raises:
        ValueError: for counts so large that 64 bits do not hold their products.
    """
    if counters.n.max() >= 2**60 // counters.dimension:
        raise ValueError(
            f"counters: expected fewer samples, found {int(counters.n.max())}"
        )
    dimension = counters.dimension
    numbers = zip(_squares(counters), counters.n.tolist(), strict=True)
    found = [norm(square, n, dimension, size) for square, n in numbers]
    lengths = torch.tensor(found, dtype=torch.float64, device=words.device)
    products = dot(counters.planes, counters.n, words, dimension)
    return products / lengths.clamp(min=1)


def cosines_without(
    counters: Counters, words: Tensor, rows: Tensor, size: int | None = None
) -> Tensor:
    """√D times the cosine of m counted hypervectors x and 2c − n of their class without x: [m].

    If s = 2c − n, then without x the product s·x becomes s·x − D, and ‖s‖² becomes
    ‖s‖² − 2s·x + D. The cosine is 0 for the only frame of a class.
    """
    dimension = counters.dimension
    products = dot(counters.planes, counters.n, words, dimension).cpu()
    squares, counts = _squares(counters), counters.n.tolist()
    found = torch.zeros(len(rows), dtype=torch.float64)
    for i, c in enumerate(rows.tolist()):
        product = int(products[i, c])
        square = squares[c] - 2 * product + dimension
        length = norm(square, counts[c] - 1, dimension, size)
        found[i] = (product - dimension) / max(length, 1.0)
    return found


def _squares(counters: Counters) -> list[int]:
    """‖2c − n‖² of each class, in integers."""
    found = []
    for planes, n in zip(counters.planes, counters.n.tolist(), strict=True):
        total, square = moments(planes)
        found.append(4 * square - 4 * n * total + n * n * counters.dimension)
    return found


def norm(square: int, n: int, dimension: int, size: int | None) -> float:
    """‖2c − n‖ from its square, or the expected value for a random subset of `size` frames."""
    if size is None or n <= max(size, 1):
        return math.sqrt(square)
    # n·D + Σ_{i≠k} x_i·x_k = ‖s‖², and a subset has the same mean product of a pair.
    of_pairs = square - n * dimension
    pairs = of_pairs * size * (size - 1) / (n * (n - 1))
    expected = max(0.0, size * dimension + pairs)
    return math.sqrt(expected) * n / size


def moments(planes: Tensor) -> tuple[int, int]:
    """Σ_j c_j and Σ_j c_j² from bit-sliced counts [P, W], in integers.

    c² = Σ_p Σ_q 2^(p+q) b_p b_q, and the sum of b_p b_q over j is a count of ones.
    """
    first = second = 0
    for p, plane in enumerate(planes):
        ones, *in_both = bits.count_ones(plane & planes[p:]).tolist()
        first += ones << p
        second += ones << 2 * p
        for q, n in enumerate(in_both, p + 1):
            second += n << (p + q + 1)  # b_p b_q and b_q b_p
    return first, second
