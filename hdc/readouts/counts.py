"""Integer prototypes: the counts themselves, compared by the cosine."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from hdc import bits
from hdc.parameters import check_choice
from hdc.prototypes import Counters
from hdc.readouts.arithmetic import dot
from hdc.readouts.base import without_empty
from hdc.readouts.majority import Counting, smallest


class Counts(Counting):
    """Nearest class by the cosine between 2c − n, for counts c of n frames, and a bipolar query.

    Args:
        ties, balance, seed: as of :class:`hdc.readouts.Majority`. Ties and seed decide only
            the binary prototypes that rejection compares with; a larger class is compared as a
            random subset of the size of the smallest is expected to be.

    Attributes: as of :class:`hdc.readouts.majority.Counting`.
    """

    def __init__(self, ties: str = "zero", balance: bool = True, seed: int = 0):
        self.ties = ties
        self.balance = balance
        self.seed = seed

    def scores(self, words: Tensor) -> Tensor:
        """The cosines, float64 [Q, L]."""
        counters = self.counters_
        size = None
        if self.balance and not self.recalibrated_:
            size = smallest(counters)
        found = cosines(counters, words, size) / math.sqrt(counters.dimension)
        return without_empty(found, counters.n == 0)

    def adapt(
        self, words: Tensor, rows: Tensor, share: float, seed: int, method: str
    ) -> None:
        check_choice("method", method, ("merge",))  # counts have no bits to replace
        super().adapt(words, rows, share, seed, method)

    def state(self) -> dict[str, Tensor]:
        return {"counters": self.counters_.planes}


def cosines(counters: Counters, words: Tensor, size: int | None = None) -> Tensor:
    """√D times the cosine of queries int64 [Q, W] and 2c − n: float64 [Q, L].

    A class of more than `size` samples is compared as a random subset of so many is expected to be.

    Raises:
        ValueError: for counts so large that 64 bits do not hold their products.
    """
    if counters.n.max() >= 2**60 // counters.dimension:
        raise ValueError(
            f"counters: expected fewer samples, found {int(counters.n.max())}"
        )
    found = norms(counters, size)
    lengths = torch.tensor(found, dtype=torch.float64, device=words.device)
    ones = bits.count_ones(counters.planes)
    products = dot(counters.planes, ones, counters.n, words, counters.dimension)
    return products / lengths.clamp(min=1)


def norms(counters: Counters, size: int | None = None) -> list[float]:
    """‖2c − n‖ of each class, correctly rounded; see :func:`cosines` for `size`."""
    lengths = []
    for planes, n in zip(counters.planes, counters.n.tolist(), strict=True):
        total, square = moments(planes)
        length = 4 * square - 4 * n * total + n * n * counters.dimension
        if size is None or n <= max(size, 1):
            lengths.append(math.sqrt(length))
            continue
        # n·D + Σ_{i≠k} x_i·x_k = ‖s‖², and the mean product of a pair is that of a subset's.
        of_pairs = length - n * counters.dimension
        pairs = of_pairs * size * (size - 1) / (n * (n - 1))
        square = max(0.0, size * counters.dimension + pairs)
        lengths.append(math.sqrt(square) * n / size)
    return lengths


def moments(planes: Tensor) -> tuple[int, int]:
    """Σ_j c_j and Σ_j c_j² of bit-sliced counts [P, W], in integers.

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
