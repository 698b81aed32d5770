"""Discriminant analysis solved among the frames, of any products G of them, or among few bits.

With N frames, n_c of class c, and L classes,

    E = onehot/n_c,  E' = E − mean over classes,  C = I − E·onehotᵀ
    K = C·G·C                                      products of frames minus the mean of their class
    A = E' − C·(K + ℓ·I)⁻¹·C·G·E'                  dual weights
    b_c = −½·(E_c + mean over classes of E)ᵀ·G·A_c

and the score of a query x for class c is g(x)ᵀ·A_c + b_c, with its products g(x) with the frames.

Frames x ∈ {±1}^D that outnumber their bits are solved among these, where the equations are fewer,

    S = Xᵀ·C·X                                     scatter within classes
    w_c = ℓ·(S + ℓ·I)⁻¹·m_c,  m = E'ᵀ·X            weights of the bits, w = Aᵀ·X
    b_c = −½·(μ_c + mean over classes of μ)·w_c    of the means μ = Eᵀ·X

with the same solution but for rounding, of some N·κ·ε by either, for the condition number κ of the
equations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.parameters import check_share
from hdc.readouts.arithmetic import in_parts, scatter, signs
from hdc.readouts.base import HeldOut
from hdc.readouts.leave_one_out import (
    Products,
    discriminants,
    inverse_squares,
    spread_over,
)

_ROWS = 256  # rows of the products changed at a time
_NOTHING = 1e-9  # share of the products that rounding leaves of equal frames
_LEAST = 1e-10  # of the mean of K's diagonal, the least penalty: rounding's share


class Solution(NamedTuple):
    """Discriminants that are learned with one penalty.

    Attributes:
        dual: A, float64 [N, L]; of a problem among bits w, [D, L].
        offsets: b, float64 [L].
        products: for the scores of frames without themselves.
    """

    dual: Tensor
    offsets: Tensor
    products: Products


@dataclass(frozen=True)
class Problem:
    """The part that does not depend on the penalty; :meth:`of` products and classes.

    Attributes:
        products: K, float64 [N, N], with a penalty on its diagonal once solved.
        diagonal: that of K, float64 [N].
        share: E, float64 [N, L].
        of_means: G·E, float64 [N, L].
        right: C·G·E', float64 [N, L].
        between: E'ᵀ·G·E', float64 [L, L].
        onehot: float64 [N, L].
        is_empty: whether no class has two different frames.
    """

    products: Tensor
    diagonal: Tensor
    onehot: Tensor
    share: Tensor
    of_means: Tensor
    right: Tensor
    between: Tensor
    is_empty: bool

    @classmethod
    def of(cls, products: Tensor, rows: Tensor) -> Self:
        """Make it from products G, float64 [N, N], which become K, to save memory.

        `rows` are the classes int64 [N], each of them with a frame.
        """
        onehot = torch.nn.functional.one_hot(rows).double()
        share = onehot / onehot.sum(0)
        size = float(products.diagonal().mean())
        of_means = products @ share
        centred = share - share.mean(1, keepdim=True)
        right = of_means - of_means.mean(1, keepdim=True)  # G·E'
        between = centred.T @ right
        right = right - onehot @ (share.T @ right)
        _centre_within_classes(products, of_means, onehot, share)
        diagonal = products.diagonal().clone()
        return cls(
            products=products,
            diagonal=diagonal,
            onehot=onehot,
            share=share,
            of_means=of_means,
            right=right,
            between=between,
            is_empty=float(diagonal.sum()) / len(products) < _NOTHING * size,
        )

    @property
    def n_classes(self) -> int:
        return self.onehot.shape[1]

    @property
    def trace(self) -> float:
        """tr K."""
        return float(self.diagonal.sum())

    def solve(self, penalty: float | None) -> Solution:
        """With ℓ, but for rounding's share at least; None is the nearest mean, ℓ without end."""
        rows = self.onehot.argmax(1)
        chosen = spread_over(rows)
        centred = self.share - self.share.mean(1, keepdim=True)
        if penalty is None:
            counts = self.onehot.sum(0)[rows[chosen]]
            left = (counts - 1) / counts - self.diagonal[chosen]
            nearest = Products(self.right, self.between, left, None)
            return Solution(centred, self._offsets(centred), nearest)
        penalty = max(penalty, _LEAST * self.trace / len(self.products))
        self.products.diagonal().copy_(self.diagonal + penalty)
        factor = torch.linalg.cholesky(self.products)
        solved = torch.cholesky_solve(self.right, factor)
        of_mean_pairs = (self.between - self.right.T @ solved) / penalty
        left = penalty * inverse_squares(factor, self._columns(chosen))
        dual = centred - (solved - self.share @ (self.onehot.T @ solved))
        kept = Products(solved, of_mean_pairs, left, penalty)
        return Solution(dual, self._offsets(dual), kept)

    def _columns(self, places: Tensor) -> Tensor:
        """Columns [N, m] of C."""
        columns = -self.share @ self.onehot[places].T
        columns[places, torch.arange(len(places))] += 1
        return columns

    def _offsets(self, dual: Tensor) -> Tensor:
        halfway = self.of_means + self.of_means.mean(1, keepdim=True)
        return -0.5 * (halfway * dual).sum(0)


@dataclass(frozen=True)
class Primal:
    """:class:`Problem` among the D bits of frames in ±1; :meth:`of` hypervectors and classes.

    Attributes:
        products: S, float64 [D, D].
        diagonal: that of K, float64 [N].
        words: N hypervectors.
        rows: their classes int64 [N].
        means: μ, float64 [L, D].
    """

    products: Tensor
    diagonal: Tensor
    words: Hypervectors
    rows: Tensor
    means: Tensor

    @classmethod
    def of(cls, words: Hypervectors, rows: Tensor) -> Self:
        """Make it from hypervectors of classes int64 [N], each of them with a frame."""
        products, means = scatter(words, rows)
        problem = cls(products, torch.empty(len(rows)), words, rows, means)
        squares = [(d**2).sum(1) for d in problem._inside()]
        return replace(problem, diagonal=torch.cat(squares))

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
        """As of :class:`Problem`, with weights of the bits."""
        apart = (self.means - self.means.mean(0)).T
        chosen = spread_over(self.rows)
        inside = signs(self.words[chosen]) - self.means[self.rows[chosen]]
        if penalty is None:
            weights = solved = apart
            own = self.diagonal[chosen]
        else:
            penalty = max(penalty, _LEAST * self.trace / len(self.rows))
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
        """Frames minus the mean of their class, float64 [B, D] each."""
        for part in in_parts(self.words):
            yield signs(self.words[part]) - self.means[self.rows[part]]


def _centre_within_classes(
    products: Tensor, of_means: Tensor, onehot: Tensor, share: Tensor
) -> None:
    """C·G·C in place of G, some rows at a time."""
    between = share.T @ of_means  # Eᵀ·G·E
    for start in range(0, len(products), _ROWS):
        rows = slice(start, start + _ROWS)
        member = onehot[rows]
        products[rows] -= of_means[rows] @ onehot.T
        products[rows] -= member @ of_means.T
        products[rows] += (member @ between) @ onehot.T


def held_out_of(
    products: Products, place: Tensor, known: Tensor, n_classes: int, unit: float = 1.0
) -> HeldOut:
    """Scores of the training frames :func:`spread_over` without themselves, times a unit.

    Args:
        products: of a solution.
        place: which of the `known` classes, int64 [K], each frame is of, int64 [N].
        known: classes with a frame; the other columns are zero.
        n_classes: L.
        unit: of the scores.
    """
    found, places = discriminants(products, place)
    scores = torch.zeros(len(places), n_classes, dtype=torch.float64)
    scores[:, known] = unit * found
    return HeldOut(scores, known[place[places]])


def check_mixed(share: float, rows: Tensor) -> None:
    """Raise ValueError for a share of new discriminants outside [0, 1], or of 1 for new frames of a
    single class int64 [N], whose discriminants are zero."""
    check_share("p", share, "[0, 1]")
    if share == 1 and len(rows.unique()) == 1:
        raise ValueError(
            "p: expected a share below 1 with new frames of a single class, found 1"
        )
