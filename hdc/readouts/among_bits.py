"""Discriminant analysis solved among the bits of frames that outnumber them.

With C, E, E' and the penalty ℓ of :mod:`hdc.readouts.discriminant`, and frames x ∈ {±1}^D,

    S = Xᵀ·C·X                                     scatter within classes, D × D
    w_c = ℓ·(S + ℓ·I)⁻¹·m_c,  m = E'ᵀ·X            weights of the bits, w = Aᵀ·X
    b_c = −½·(μ_c + mean over classes of μ)·w_c    of the means μ = Eᵀ·X

The solution equals that of :class:`hdc.readouts.discriminant.Problem` up to rounding errors of
about N·κ·ε, for the condition number κ of the equations.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.readouts.discriminant import (
    LEAST,
    Products,
    Solution,
    inverse_squares,
    spread_over,
)

_SIGNS = 2**20  # bits unpacked to floats at a time


@dataclass(frozen=True)
class ProblemAmongBits:
    """The equations among D bits, in place of :class:`hdc.readouts.discriminant.Problem`.

    Attributes:
        products: S, float64 [D, D].
        words: N hypervectors.
        rows: their classes int64 [N].
        means: μ, float64 [L, D].
    """

    products: Tensor
    words: Hypervectors
    rows: Tensor
    means: Tensor

    @classmethod
    def of(cls, words: Hypervectors, rows: Tensor) -> Self:
        """Set up the equations of hypervectors and their classes int64 [N], which all occur."""
        products, means = scatter(words, rows)
        return cls(products, words, rows, means)

    @functools.cached_property
    def diagonal(self) -> Tensor:
        """Diagonal of K, float64 [N]."""
        return torch.cat([(d**2).sum(1) for d in self._inside()])

    @property
    def n_classes(self) -> int:
        return len(self.means)

    @property
    def is_empty(self) -> bool:
        return not self.diagonal.any()

    @property
    def trace(self) -> float:
        """tr S."""
        return float(self.diagonal.sum())

    def solve(self, penalty: float | None) -> Solution:
        """Solve with penalty ℓ, as :meth:`hdc.readouts.discriminant.Problem.solve`."""
        apart = (self.means - self.means.mean(0)).T
        chosen = spread_over(self.rows)
        inside = signs(self.words[chosen]) - self.means[self.rows[chosen]]
        if penalty is None:
            weights = solved = apart
            own = self.diagonal[chosen]
        else:
            penalty = max(penalty, LEAST * self.trace / len(self.rows))
            matrix = self.products.clone()
            matrix.diagonal().add_(penalty)
            factor = torch.linalg.cholesky(matrix)
            solved = torch.cholesky_solve(apart, factor)
            weights = penalty * solved
            own = inverse_squares(factor, inside.T)
        frames = torch.cat([d @ solved for d in self._inside()])
        halfway = (self.means + self.means.mean(0)) / 2
        offsets = -(halfway.T * weights).sum(0)
        counts = torch.bincount(self.rows)[self.rows[chosen]]
        left = (counts - 1) / counts.double() - own
        kept = Products(frames, apart.T @ solved, left, penalty)
        return Solution(weights, offsets, kept)

    def _inside(self) -> Iterator[Tensor]:
        """Frames minus the mean of their class, float64 [B, D], in parts."""
        for part in in_parts(self.words):
            yield signs(self.words[part]) - self.means[self.rows[part]]


def signs(words: Hypervectors) -> Tensor:
    """The bits in ±1, float64 [N, D] (CPU)."""
    ones = bits.unpack(words.packed.cpu(), words.dimension)
    return ones.double().mul_(2).sub_(1)


def in_parts(words: Hypervectors) -> Iterator[slice]:
    """Slices of hypervectors that are unpacked at a time."""
    step = max(1, _SIGNS // words.dimension)
    for start in range(0, len(words), step):
        yield slice(start, start + step)


def scatter(words: Hypervectors, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Scatter Σ (x − μ)·(x − μ)ᵀ of frames in ±1 about the means μ of their classes, and the means.

    Sums are whole numbers, exact below 2⁵³, up to one division per class.

    Args:
        words: N hypervectors.
        rows: their classes int64 [N] (CPU); each of 0 … L − 1 occurs.

    Returns:
        Scatter float64 [D, D] and means float64 [L, D] (CPU).
    """
    size = words.dimension
    total = torch.zeros(size, size, dtype=torch.float64)
    means = []
    for c in range(int(rows.max()) + 1):
        of_class = words[rows == c]
        n = len(of_class)
        products = torch.zeros_like(total)
        sums = torch.zeros(size, dtype=torch.float64)
        for part in in_parts(of_class):
            x = signs(of_class[part])
            products.addmm_(x.T, x)
            sums += x.sum(0)
        total += products.mul_(n).addr_(sums, sums, alpha=-1).div_(n)
        means.append(sums / n)
    return total, torch.stack(means)
