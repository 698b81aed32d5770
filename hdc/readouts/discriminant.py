"""Discriminant analysis of N frames, solved among the frames by any products G of them.

With n_c frames of class c, and L classes,

    E = onehot/n_c,  E' = E − mean over classes,  C = I − E·onehotᵀ
    K = C·G·C                                      products of frames minus the mean of their class
    A = E' − C·(K + ℓ·I)⁻¹·C·G·E'                  dual weights
    b_c = −½·(E_c + mean over classes of E)ᵀ·G·A_c

and the score of a query x for class c is g(x)ᵀ·A_c + b_c, with its products g(x) with the frames.
Frames that outnumber their bits are solved by :mod:`hdc.readouts.among_bits`.

**Leave-one-out scores** have a closed form. With m_c = μ_c − μ and M = S + ℓ·I, for the scatter
S = Σ d_i·d_iᵀ of the frames minus the mean of their class, the discriminant of class c is

    ℓ·(x − ½(μ_c + μ))ᵀ·M⁻¹·m_c.

Without a frame x = μ_y + d of a class of n frames, μ_y moves by −d/(n − 1), and S loses
n/(n − 1)·d·dᵀ, so that M⁻¹ follows by Sherman and Morrison's formula. ℓ stays. Only products with
M⁻¹ of d and of the means are needed (:class:`Products`). The formula's denominator is what
dᵀ·M⁻¹·d leaves of (n − 1)/n, nearly nothing under a weak penalty: among frames it is
ℓ·cᵀ·(K + ℓ·I)⁻¹·c, for the frame's column c of C, and needs no subtraction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import torch
from torch import Tensor

from hdc.readouts.base import HeldOut

MOST_FRAMES = 8000
"""Training frames at most, for a read-out that needs the products of all pairs."""
MOST = 400
"""Left-out frames that are scored, evenly spread: enough to fit a temperature."""
OF_CLASS = 19
"""Left-out frames of each class at least, if it has as many: p-values in steps of 5 %."""
_ROWS = 256  # rows of the products changed at a time
_NOTHING = 1e-9  # of the products: what rounding leaves between equal frames
LEAST = 1e-10  # least penalty, the rounding error, in units of the mean of K's diagonal


@dataclass(frozen=True)
class Problem:
    """The part of the equations that does not depend on the penalty.

    Attributes:
        products: K, float64 [N, N], with a penalty on its diagonal once solved.
        diagonal: diagonal of K, float64 [N].
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
        """Set up the equations.

        Args:
            products: G, float64 [N, N], which is overwritten by K to save memory.
            rows: classes int64 [N]; each of 0 … L − 1 occurs.
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
        """Solve with penalty ℓ, at least the rounding error; None is ℓ → ∞, the nearest mean."""
        rows = self.onehot.argmax(1)
        chosen = spread_over(rows)
        centred = self.share - self.share.mean(1, keepdim=True)
        if penalty is None:
            counts = self.onehot.sum(0)[rows[chosen]]
            left = (counts - 1) / counts - self.diagonal[chosen]
            nearest = Products(self.right, self.between, left, None)
            return Solution(centred, self._offsets(centred), nearest)
        penalty = max(penalty, LEAST * self.trace / len(self.products))
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


class Solution(NamedTuple):
    """Discriminants for one penalty.

    Attributes:
        dual: A, float64 [N, L]; if solved among bits, w [D, L].
        offsets: b, float64 [L].
        products: products for the scores of left-out frames.
    """

    dual: Tensor
    offsets: Tensor
    products: Products


@dataclass(frozen=True)
class Products:
    """Products with M⁻¹, or, for the nearest mean, where ℓ is infinite, with the identity.

    Attributes:
        frames: d_iᵀ·M⁻¹·m_c, float64 [N, L].
        means: m_cᵀ·M⁻¹·m_k, float64 [L, L].
        left: (n − 1)/n − d_iᵀ·M⁻¹·d_i of the frames :func:`spread_over`, in a class of n frames,
            float64 [m].
        penalty: ℓ; None if it is infinite.
    """

    frames: Tensor
    means: Tensor
    left: Tensor
    penalty: float | None


def _centre_within_classes(
    products: Tensor, of_means: Tensor, onehot: Tensor, share: Tensor
) -> None:
    """Overwrite G by C·G·C, some rows at a time."""
    between = share.T @ of_means  # Eᵀ·G·E
    for start in range(0, len(products), _ROWS):
        rows = slice(start, start + _ROWS)
        member = onehot[rows]
        products[rows] -= of_means[rows] @ onehot.T
        products[rows] -= member @ of_means.T
        products[rows] += (member @ between) @ onehot.T


# Leave-one-out -----------------------------------------------------------------------------------


def spread_over(rows: Tensor) -> Tensor:
    """Places [m], in rising order, of frames to score, among N frames of classes int64 [N].

    They are evenly spread, with more of the classes that have too few among them, since a class
    without scores would be in every prediction set. The only frame of a class is not scored.
    """
    places = evenly(len(rows))
    every = [places]
    classes = rows.unique() if len(places) < len(rows) else ()
    for c in classes:
        of_class = (rows == c).nonzero().flatten()
        if int((rows[places] == c).sum()) < OF_CLASS:
            every.append(of_class[evenly(len(of_class), OF_CLASS)])
    chosen = torch.cat(every).unique()
    return chosen[rows.bincount()[rows[chosen]] > 1]


def evenly(n: int, most: int | None = None) -> Tensor:
    """Evenly spread places int64 [m] among n frames, at most `most`, by default :data:`MOST`."""
    return torch.linspace(0, n - 1, min(n, most or MOST)).round().long()


def inverse_squares(factor: Tensor, columns: Tensor) -> Tensor:
    """cᵀ·(F·Fᵀ)⁻¹·c [m] of columns c [N, m] for a lower triangular F [N, N]."""
    halves = torch.linalg.solve_triangular(factor, columns, upper=False)
    return (halves**2).sum(0)


def discriminants(products: Products, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Leave-one-out scores float64 [m, L] of the frames :func:`spread_over`, and their places [m].

    Args:
        products: products of all frames.
        rows: classes int64 [N] of the frames.
    """
    n_classes = products.means.shape[0]
    chosen = spread_over(rows)
    left = products.left[:, None]
    row = rows[chosen]
    n = rows.bincount()[row].double()[:, None]
    own = (n - 1) / n - left
    is_own = torch.nn.functional.one_hot(row, n_classes).double()
    moved = 1 / (n - 1)
    frames = products.frames[chosen]
    of_class = frames.gather(1, row[:, None])
    squares = products.means.diagonal()
    # x minus half the sum of both means is m_y − ½·m_c and `more` times d; m_c gains `gained`·d.
    more = 1 + moved / 2 * (is_own + 1 / n_classes)
    gained = moved * (1 / n_classes - is_own)
    along = of_class - frames / 2 + more * own
    scores = products.means[row] - squares / 2 + more * frames + gained * along
    if products.penalty is None:
        return scores, chosen
    lost = along * (frames + gained * own) / left
    return products.penalty * (scores + lost), chosen


def held_out_of(products: Products, rows: Tensor, unit: float = 1.0) -> HeldOut:
    """The scores of :func:`discriminants` for frames of classes int64 [N], times a unit."""
    scores, places = discriminants(products, rows)
    return HeldOut(unit * scores, rows[places])


def check_memory(readout: str, size: int, what: str = "frames") -> None:
    """Raise ValueError where the products of all pairs would not fit in memory.

    Args:
        readout: name of the read-out, for the error.
        size: rows of the products: training frames, or bits where these are fewer.
        what: of what there may be too many, for the error.
    """
    if size > MOST_FRAMES:
        raise ValueError(
            f"{readout}: expected at most {MOST_FRAMES} {what}, found {size}; train on fewer "
            "frames of each class, on fewer pixels (--subsample), or with a read-out without "
            "products of all pairs, such as 'neighbours'"
        )
