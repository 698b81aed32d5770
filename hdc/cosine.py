"""Integer prototypes: the counts themselves, compared by the cosine with bipolar queries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from hdc import bits
from hdc.prototypes import Counters


def moments(planes: Tensor) -> tuple[int, int]:
    """Σ_j c_j and Σ_j c_j² of bit-sliced counts [P, W], in integers.

    c² = Σ_p Σ_q 2^(p+q) b_p b_q, and the sum of b_p b_q over j is a count of ones.
    """
    first = second = 0
    for p, plane in enumerate(planes):
        ones = bits.count_ones(plane & planes[p:]).tolist()
        first += ones[0] << p
        second += ones[0] << 2 * p
        second += sum(n << (2 * p + k + 1) for k, n in enumerate(ones[1:], 1))
    return first, second


@dataclass(frozen=True)
class Cosine:
    """Minus √D times the cosine of queries and 2c − n, from the planes of c alone.

    Attributes:
        counters: the counts c and numbers of samples n of L classes.
        plane_ones: int64 [L, P], ones of each plane.
        squares: float64 [L], ‖2c − n‖².
        norms: float64 [L], their roots, correctly rounded (those of torch are not always).
    """

    counters: Counters
    plane_ones: Tensor
    squares: Tensor
    norms: Tensor

    @classmethod
    def of(cls, counters: Counters) -> Cosine:
        """Work out once what every query needs."""
        d, squares = counters.dimension, []
        for planes, n in zip(counters.planes, counters.n.tolist(), strict=True):
            total, square = moments(planes)
            squares.append(float(4 * square - 4 * n * total + n * n * d))
        norms = [math.sqrt(square) for square in squares]
        return cls(
            counters,
            bits.count_ones(counters.planes),
            torch.tensor(squares, dtype=torch.float64),
            torch.tensor(norms, dtype=torch.float64),
        )

    def scores(self, words: Tensor) -> Tensor:
        """Dissimilarities float64 [Q, L] of hypervectors int64 [Q, W], smaller is nearer."""
        dot = self._dot(words)
        return -dot / self.norms.to(words.device).clamp(min=1)

    def held_out(self, words: Tensor, own: Tensor, weights: Tensor) -> Tensor:
        """Scores [Q] with the class of each, int64 [Q], as if it had not been counted there.

        A hypervector x in ±1 that was counted w times has x·(s − w·x) = x·s − w·D, and
        ‖s − w·x‖² = ‖s‖² − 2w·x·s + w²·D.
        """
        rows, d = torch.arange(len(words)), self.counters.dimension
        own, weights = own.to(words.device), weights.to(words.device)
        dot = self._dot(words)[rows.to(words.device), own].double()
        squares = self.squares.to(words.device)[own] - 2 * weights * dot + weights**2 * d
        return -(dot - weights * d) / squares.clamp(min=1).sqrt()

    def _dot(self, words: Tensor) -> Tensor:
        """(2v − 1)·(2c − n), int64 [Q, L].

        A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ plane_p| and |v ∧ b| = (|v| + |b| − Ham(v, b))/2.
        """
        planes, n = self.counters.planes, self.counters.n.to(words.device)
        n_classes, n_planes, width = planes.shape
        weights = 2 ** torch.arange(n_planes, device=words.device)
        ones = bits.count_ones(words)
        distances = bits.hamming(words, planes.reshape(-1, width)).view(-1, n_classes, n_planes)
        overlap = (ones[:, None, None] + self.plane_ones - distances) // 2
        dot = (overlap * weights).sum(2)
        total = (self.plane_ones * weights).sum(1)
        return 4 * dot - 2 * total - n * (2 * ones[:, None] - self.counters.dimension)
