"""Discriminant scores of training frames as if each had not been learnt, in closed form.

With m_c = μ_c − μ and M = S + ℓ·I, for the scatter S = Σ d_i·d_iᵀ of the frames minus the mean of
their class, the discriminant of class c is

    ℓ·(x − ½(μ_c + μ))ᵀ·M⁻¹·m_c.

Without a frame x = μ_y + d of a class of n frames, μ_y moves by −d/(n − 1), and S loses
n/(n − 1)·d·dᵀ, so that M⁻¹ follows by Sherman and Morrison's formula. ℓ stays. All that is needed
are products with M⁻¹ of d and of the means, which :mod:`hdc.readouts.discriminant` has. The
formula's denominator is what dᵀ·M⁻¹·d leaves of (n − 1)/n, nearly nothing under a weak penalty:
among frames it is ℓ·cᵀ·(K + ℓ·I)⁻¹·c, for the frame's column c of C, and needs no subtraction.
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
        left: (n − 1)/n − d_iᵀ·M⁻¹·d_i of the frames :func:`spread_over`, in a class of n frames,
            float64 [m].
        penalty: ℓ; None if it is infinite.
    """

    frames: Tensor
    means: Tensor
    left: Tensor
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


def inverse_squares(factor: Tensor, columns: Tensor) -> Tensor:
    """cᵀ·(F·Fᵀ)⁻¹·c [m] of columns c [N, m] for a lower triangular F [N, N]."""
    halves = torch.linalg.solve_triangular(factor, columns, upper=False)
    return (halves**2).sum(0)


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
    chosen, left = chosen[several], products.left[several][:, None]
    row = rows[chosen]
    n = counts[row].double()[:, None]
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
