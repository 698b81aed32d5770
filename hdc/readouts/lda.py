"""Shrinkage discriminant analysis of the bits, with weights of four bits per pixel.

Linear discriminant analysis with a shrunken covariance (Friedman, JASA 84, 165 (1989)), solved
among the N frames (:mod:`hdc.readouts.discriminant`) with x ∈ {±1}^D and

    G = X·Xᵀ = D − 2·Hamming                       integers, N × N
    w = Aᵀ·X                                       weights of the bits

or, with more frames than bits, among the bits (:mod:`hdc.readouts.among_bits`).

The shrunken covariance is (1 − α)·S + α·(tr S/D)·I, so that ℓ = α/(1 − α)·tr(K)/D; α = 1 is the
nearest mean.

Weights are rounded to q ∈ {−7 … 7}, in units of one seventh of their 99.5 % quantile. Zero is among
the values, so that a pixel without information does not affect scores when it flips. A scale and an
offset per class preserve the scores of the class's mean and of the mean of means. They are rounded
to integers, so that all scores of a trained model are integers, the same on every machine. Training
is in floating point: with another backend, processor or number of threads, scales and offsets may
differ in their last digits, and rarely a weight by one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from hdc import bits
from hdc.bits import combinations, gram, shifted_dot
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_share, is_number
from hdc.readouts.among_bits import ProblemAmongBits
from hdc.readouts.base import HeldOut, Readout, State
from hdc.readouts.discriminant import (
    Problem,
    Solution,
    check_memory,
    held_out_of,
    spread_over,
)
from hdc.tensors import Kinds
from hdc.warning import warn

LEDOIT_WOLF = "ledoit_wolf"
_LEVELS, _OFFSET, _PLANES = 7, 8, 4  # weights are stored as q + 8, bit-sliced
_CLIPPED = 0.995  # quantile of the weights that becomes the largest
_NONE = 1e-9  # of the largest weight: what rounding leaves of a constant pixel
_UNIT_BITS = 20  # of the largest scale


@dataclass(frozen=True, kw_only=True, eq=False)
class Discriminants(State):
    """The score of a query x for a class is scale·(q·x) + offset."""

    kinds: ClassVar[Kinds] = {
        "weights": "int64 L 4 W",
        "scales": "int64 L",
        "offsets": "int64 L",
        "shrinkage": "float64",
    }
    weights: Tensor
    """int64 [L, 4, W], q + 8 bit-sliced."""
    scales: Tensor
    """int64 [L] (CPU)."""
    offsets: Tensor
    """int64 [L] (CPU)."""
    shrinkage: Tensor
    """float64 [], α."""

    def floats(self, dimension: int) -> Tensor:
        """The weights in the units of the scores, float32 [L, D] (CPU)."""
        shifted = bits.numbers_of(self.weights.cpu(), dimension)
        return (shifted - _OFFSET).float() * self.scales[:, None].float()


class LDA(Readout):
    """Shrinkage discriminant analysis, with equal weights of classes of any size.

    Unlike scikit-learn's ``LinearDiscriminantAnalysis(shrinkage="auto")`` it does not standardise
    features, has one covariance of the frames within all classes, and equal priors.

    Args:
        shrinkage: α in [0, 1], or the closed form ``"ledoit_wolf"`` (J. Multivar. Anal. 88, 365
            (2004)).
    """

    State = Discriminants
    needs = ("weights", "scales", "offsets")
    adapts_by = ("p",)

    def __init__(self, shrinkage: float | str = LEDOIT_WOLF):
        self.shrinkage = shrinkage

    def check(self) -> None:
        given: Any = self.shrinkage
        is_share = is_number(given) and 0 <= given <= 1
        if not is_share and str(given) != LEDOIT_WOLF:
            raise ValueError(
                f"shrinkage: expected {LEDOIT_WOLF!r}, or a share in [0, 1], found {given!r}"
            )

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Discriminants:
        """See :meth:`hdc.readouts.base.Readout.fit`.

        Raises:
            ValueError: for more than 8000 frames of more than 8000 bits, for which the products of
                all pairs, of frames or of bits, are too large.
        """
        dimension = words.dimension
        check_memory("lda", min(len(rows), dimension), "frames or bits")
        problem = problem_of(words, rows)
        if problem.is_empty:
            warn(
                "lda: no class has two different frames, so the nearest mean is learned",
            )
        alpha, solution = shrunken(problem, dimension, self.shrinkage)
        weights, offsets, products = solution
        if isinstance(problem, ProblemAmongBits):
            weights = weights.T.float()
        else:
            weights = combinations(weights, words.packed)[:, :dimension]
        means = class_means(words, rows, n_classes)
        state, unit = _stored(weights, means, offsets, alpha, words.packed.device)
        return replace(state, held_out=held_out_of(products, rows, unit))

    def adapt(
        self, state: Discriminants, words: Hypervectors, rows: Tensor, share: float
    ) -> Discriminants:
        """Mix the old discriminants and the discriminants of new frames.

        Both are divided by the norm of their weights; `share` is the weight of the new ones. A
        class without new frames keeps its old discriminant; nothing is then held out.

        Raises:
            ValueError: for a share outside [0, 1], or 1 with new frames of a single class.
        """
        check_share("p", share, "[0, 1]")
        if share == 1 and len(rows.unique()) == 1:  # whose discriminants are zero
            raise ValueError(
                "p: expected a share below 1 with new frames of a single class, found 1; "
                "use p < 1, or frames of two classes"
            )
        known, place = rows.unique(return_inverse=True)
        new = self.fit(words, place, len(known))
        old_weights = state.floats(words.dimension)
        new_weights = new.floats(words.dimension)
        before = (1 - share) / (float(old_weights.norm()) or 1.0)
        after = share / (float(new_weights.norm()) or 1.0)
        weights, offsets = before * old_weights, before * state.offsets.double()
        weights[known] += after * new_weights
        offsets[known] += after * new.offsets.double()
        means = class_means(words, place, len(known))
        full = means.mean(0).repeat(len(weights), 1)
        full[known] = means
        alpha, device = float(new.shrinkage), words.packed.device
        mixed, unit = _stored(weights, full, offsets, alpha, device)
        if len(known) < len(weights):
            return mixed
        held_out = new.held_out
        assert held_out is not None
        # The old discriminants have not learnt the new frames.
        old = before * self.scores(state, words[spread_over(rows)]).double().cpu()
        found = HeldOut(unit * (old + after * held_out.scores), held_out.rows)
        return replace(mixed, held_out=found)

    def scores(self, state: Discriminants, words: Hypervectors) -> Tensor:
        """The discriminants, int64 [Q, L]."""
        products = shifted_dot(state.weights, _OFFSET, words.packed, words.dimension)
        scales = state.scales.to(products.device)
        return products * scales + state.offsets.to(products.device)


def problem_of(words: Hypervectors, rows: Tensor) -> Problem | ProblemAmongBits:
    """The equations among frames or among bits, whichever are fewer; all classes occur."""
    if len(rows) > words.dimension:
        return ProblemAmongBits.of(words, rows)
    return Problem.of(gram(words.packed, words.packed, words.dimension), rows)


def shrunken(
    problem: Problem | ProblemAmongBits, dimension: int, shrinkage: float | str
) -> tuple[float, Solution]:
    """α for a problem in D dimensions, and its solution; α = 1 is the nearest mean."""
    if problem.is_empty:
        alpha = 1.0
    elif isinstance(shrinkage, str):
        squares = float((problem.products**2).sum())
        degrees = max(1, len(problem.diagonal) - problem.n_classes)
        alpha = closed_form(
            problem.trace, squares, problem.diagonal, degrees, dimension
        )
    else:
        alpha = float(shrinkage)
    if alpha == 1:
        return alpha, problem.solve(None)
    return alpha, problem.solve(alpha / (1 - alpha) * problem.trace / dimension)


def closed_form(
    trace: float, squares: float, diagonal: Tensor, n: int, d: int
) -> float:
    """α by Ledoit and Wolf, for a covariance with n degrees of freedom in D dimensions.

    Args:
        trace, squares, diagonal: tr K, ‖K‖²_F and K_ii.
        n: frames minus classes.
        d: D.
    """
    first = trace / n
    second = squares / n**2
    spread = second - first**2 / d
    if spread <= 0:
        return 1.0
    fourth = float((diagonal**2).sum()) / n**2
    share = (fourth - second / n) / spread
    return min(1.0, max(0.0, share))


def class_means(words: Hypervectors, rows: Tensor, n_classes: int) -> Tensor:
    """Means of the hypervectors of each class in ±1, float32 [L, D] (CPU)."""
    onehot = torch.nn.functional.one_hot(rows, n_classes)
    sums = combinations(onehot, words.packed)[:, : words.dimension]
    return sums / onehot.sum(0)[:, None]


def _stored(
    weights: Tensor,
    means: Tensor,
    offsets: Tensor,
    alpha: float,
    device: torch.device,
) -> tuple[Discriminants, float]:
    """The rounded state, and the unit of its scores.

    Args:
        weights, means, offsets: as in :func:`_quantised`.
        alpha: α.
        device: device of the weights.
    """
    rounded, scales, offsets = _quantised(weights, means, offsets)
    unit = 2**_UNIT_BITS / float(scales.max())
    state = Discriminants(
        weights=rounded.to(device),
        scales=(scales * unit).round().long(),
        offsets=(offsets * unit).round().long(),
        shrinkage=torch.tensor(alpha, dtype=torch.float64),
    )
    return state, unit


def _quantised(
    weights: Tensor, means: Tensor, offsets: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Rounded weights as planes int64 [L, 4, W], with scales and offsets float64 [L].

    A scale preserves the difference between the scores of the class's mean and of the mean of
    means, and an offset the score of the mean of means.

    Args:
        weights: w, float32 [L, D].
        means: means of the classes, float32 [L, D].
        offsets: offsets that belong to w, float64 [L].
    """
    centre = means.mean(0)
    in_doubles = centre.double()
    made = []
    scales = torch.ones(len(weights), dtype=torch.float64)
    offsets = offsets.clone()
    for c, w in enumerate(weights):
        steps = _LEVELS / _unit(w.abs())
        q = (w * steps).round_().clamp_(-_LEVELS, _LEVELS)
        made.append(bits.sliced((q + _OFFSET).to(torch.uint8), _PLANES))
        if not q.any():
            continue
        away = (means[c] - centre).double()
        exact, rounded = w.double(), q.double()
        kept = float(away @ rounded)
        if kept > 0:
            scales[c] = float(away @ exact) / kept
        else:
            scales[c] = float(exact @ rounded) / float(rounded @ rounded)
        lost = w - scales[c].float() * q
        offsets[c] += float(lost.double() @ in_doubles)
    return torch.stack(made), scales.clamp(min=1e-300), offsets


def _unit(sizes: Tensor) -> float:
    """The 99.5 % quantile of the sizes [D] of weights above the rounding error; 1 without any."""
    is_live = sizes > _NONE * sizes.max()
    # numpy selects and sorts much faster than torch
    live = sizes.numpy()[is_live.numpy()]
    if len(live) == 0:
        return 1.0
    place = max(1, round(_CLIPPED * len(live))) - 1
    live.partition(place)
    return float(live[place])
