"""Discriminant scores of training frames as if each had not been learnt, in closed form.

With m_c = μ_c − μ and M = S + ℓ·I, for the scatter S = Σ d_i·d_iᵀ of the frames minus the mean of
their class, the discriminant of class c is

    ℓ·(x − ½(μ_c + μ))ᵀ·M⁻¹·m_c.

Without a frame x = μ_y + d of a class of n frames, μ_y moves by −d/(n − 1), and S loses
n/(n − 1)·d·dᵀ, so that M⁻¹ follows by Sherman and Morrison's formula. ℓ stays. All that is needed
are products with M⁻¹ of d and of the means, which the dual form of :mod:`hdc.readouts.lda` has.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

MOST = 400
"""Frames that are scored, spread over all: a temperature needs no more."""
OF_CLASS = 19
"""Frames of each class that are scored at least, if it has them: p-values in steps of 5 %."""


@dataclass(frozen=True)
class Products:
    """Products with M⁻¹; of the nearest mean, for which ℓ is infinite, with the identity.

    Attributes:
        frames: d_iᵀ·M⁻¹·m_c, float64 [N, L].
        means: m_cᵀ·M⁻¹·m_k, float64 [L, L].
        own: d_iᵀ·M⁻¹·d_i of the frames :func:`spread_over`, float64 [m].
        penalty: ℓ; None if it is infinite.
    """

    frames: Tensor
    means: Tensor
    own: Tensor
    penalty: float | None


def spread_over(rows: Tensor) -> Tensor:
    """Places [m], in rising order, of some frames of the classes rows, int64 [N].

    They are evenly spread, and a class of which too few are among them adds some of its own: a
    class without scores would be in every prediction set.
    """
    places = evenly(len(rows))
    if len(places) == len(rows):
        return places
    every = [places]
    for c in rows.unique():
        of_class = (rows == c).nonzero().flatten()
        if int((rows[places] == c).sum()) < OF_CLASS:
            every.append(of_class[evenly(len(of_class), OF_CLASS)])
    return torch.cat(every).unique()


def evenly(n: int, most: int | None = None) -> Tensor:
    """Places int64 [m] of at most so many, by default :data:`MOST`, of n frames."""
    return torch.linspace(0, n - 1, min(n, most or MOST)).round().long()


def inverse_diagonal(factor: Tensor, places: Tensor) -> Tensor:
    """Entries [m] of the diagonal of (F·Fᵀ)⁻¹ for a lower triangular F [N, N]."""
    units = factor.new_zeros(len(factor), len(places))
    units[places, torch.arange(len(places))] = 1
    columns = torch.linalg.solve_triangular(factor, units, upper=False)
    return (columns**2).sum(0)


def discriminants(products: Products, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Scores float64 [m, L] of frames without themselves, and their places [m] among the N.

    The only frame of a class is left out.

    Args:
        products: of all frames.
        rows: classes int64 [N] of the frames.
    """
    n_classes = products.means.shape[0]
    chosen = spread_over(rows)
    counts = torch.bincount(rows, minlength=n_classes)
    several = counts[rows[chosen]] > 1
    chosen, own = chosen[several], products.own[several][:, None]
    row = rows[chosen]
    n = counts[row].double()[:, None]
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
    share = n * moved
    lost = share / (1 - share * own) * along * (frames + gained * own)
    return products.penalty * (scores + lost), chosen
