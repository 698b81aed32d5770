"""Ridge regression on packed bits, of classes and of numbers.

Targets y on bits x ∈ {−1, 1}^D with an intercept,

    min over w, b of Σ_i (y_i − b − w·x_i)² + λ‖w − w₀‖²        w₀ = 0, or the weights of before,

are solved among N frames: x_i·x_k = D − 2·Hamming, and with the centred Gram matrix K the change of
the weights is Xᵀa, a = (K + λ)⁻¹(y − ȳ). One eigendecomposition of K gives every penalty and its
exact leave-one-out residuals r_i = (y_i − f(x_i))/(1 − S_ii) with S = 1/N + K(K + λ)⁻¹; the penalty
with the least Σ r_i² is taken.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.parameters import is_number
from hdc.readouts.arithmetic import check_memory, gram
from hdc.readouts.base import HeldOut, Readout
from hdc.readouts.linear import Linear, quantised
from hdc.readouts.values import RESIDUALS, ValueReadout, ValueState

PENALTIES = tuple(10.0**k for k in range(-4, 5))
"""Penalties tried, in units of the mean of K's diagonal."""
_LOWEST = -1e300  # intercept of a class without frames


class Ridge(Readout):
    """Ridge regression of 1 for the class of a frame and −1 for the others.

    Args:
        penalty: λ in units of the mean of K's diagonal; None takes the one of :data:`PENALTIES`
            with the least leave-one-out error.
    """

    State = Linear
    needs = ("weights", "scales")
    adapts_by = ()

    def __init__(self, penalty: float | None = None):
        self.penalty = penalty

    def check(self) -> None:
        check_penalty(self.penalty)

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Linear:
        state = _of_classes(words, rows, n_classes, self.penalty)
        empty = torch.bincount(rows, minlength=n_classes) == 0
        state.intercepts[empty] = _LOWEST
        return state

    def adapt(self, state: Linear, words: Hypervectors, rows: Tensor) -> Linear:
        """Go to the weights near those of before that fit new frames."""
        return _of_classes(words, rows, len(state.weights), prior=state)

    def scores(self, state: Linear, words: Hypervectors) -> Tensor:
        """The linear functions, float64 [Q, L]."""
        return state.values(words)


def _of_classes(
    words: Hypervectors,
    rows: Tensor,
    n_classes: int,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> Linear:
    """The fit to 1 for the class of a frame and −1 for the others."""
    onehot = torch.eye(n_classes, dtype=torch.float64)[rows]
    targets = 2 * onehot - 1
    linear, residuals = solve(words, targets, penalty, prior)
    return replace(linear, held_out=HeldOut(targets - residuals, rows))


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearValues(Linear, ValueState):
    """A linear function of each number."""

    kinds = Linear.kinds | RESIDUALS

    @functools.cached_property
    def dual(self) -> Dual:
        """For intervals, made when they are asked for."""
        return Dual.of(self.words, float(self.penalty))


class RidgeValues(ValueReadout):
    """Ridge regression of numbers.

    Args:
        penalty: as of :class:`Ridge`.
    """

    State = LinearValues

    def __init__(self, penalty: float | None = None):
        self.penalty = penalty

    def check(self) -> None:
        check_penalty(self.penalty)

    def fit(self, words: Hypervectors, values: Tensor) -> LinearValues:
        return _of_numbers(words, values, self.penalty)

    def adapt(
        self, state: LinearValues, words: Hypervectors, values: Tensor
    ) -> LinearValues:
        """Go to the weights near those of before that fit new frames, with their penalty."""
        return _of_numbers(words, values, prior=state)

    def values(self, state: LinearValues, words: Hypervectors) -> Tensor:
        return state.values(words).cpu()

    def without(
        self, state: LinearValues, words: Hypervectors
    ) -> tuple[Tensor, Tensor]:
        """f₋ᵢ is the fit to targets of which f₋ᵢ(x_i) replaces y_i: f(x) − f₋ᵢ(x) = S_i(x)·r_i."""
        centre = self.values(state, words)
        products = gram(words.packed, state.words.packed, words.dimension)
        smoother = state.dual.smoother(products)
        assert state.residuals is not None
        moved = smoother[..., None] * state.residuals
        return centre, centre[:, None] - moved


def _of_numbers(
    words: Hypervectors,
    values: Tensor,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> LinearValues:
    linear, residuals = solve(words, values, penalty, prior)
    given: Any = linear.tensors()
    return LinearValues(**given, residuals=residuals, words=words, targets=values)


def check_penalty(penalty: Any) -> None:
    """Raise ValueError for a penalty that is neither None nor a number above zero."""
    if penalty is None:
        return
    if not is_number(penalty) or penalty <= 0:
        raise ValueError(
            f"penalty: expected a number above zero or None, found {penalty!r}"
        )


class Dual(NamedTuple):
    """Needed besides the weights for leave-one-out predictions of other frames.

    In double precision: with few frames and a small penalty single precision keeps three digits.
    """

    inverse: Tensor  # (K + λ)⁻¹, float64 [N, N]
    means: Tensor  # of each row of the Gram matrix, [N]

    @classmethod
    def of(cls, words: Hypervectors, penalty: float) -> Dual:
        """Make it from N training frames and the penalty λ of their fit."""
        products = gram(words.packed, words.packed, words.dimension)
        means = products.mean(1)
        products -= means
        products -= means[:, None] - means.mean()
        products.diagonal().add_(penalty)
        factor = torch.linalg.cholesky(products)
        return cls(torch.cholesky_inverse(factor), means)

    def smoother(self, products: Tensor) -> Tensor:
        """S_i(x) from products of Q frames with the training frames: float64 [Q, N]."""
        shift = self.means - self.means.mean()
        own_means = products.mean(1, keepdim=True)
        centred = products - own_means - shift
        return 1 / len(self.means) + centred @ self.inverse


def solve(
    words: Hypervectors,
    targets: Tensor,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> tuple[Linear, Tensor]:
    """Linear functions that fit float64 targets [N, T] of N hypervectors, and residuals r [N, T].

    Args:
        words, targets: as above.
        penalty: in units of the mean of K's diagonal; None tries :data:`PENALTIES`.
        prior: weights to stay near, with their penalty.

    Raises:
        ValueError: for more than 8000 frames, of which the matrices fill the memory.
    """
    check_memory("ridge", len(words), matrices=4)
    products = gram(words.packed, words.packed, words.dimension)
    left = targets
    if prior is not None:
        left = targets - prior.values(words).cpu()
    mean = left.mean(0)
    # Squares of numbers near 1e155 or 1e-165 are none: errors are compared in units of the largest.
    unit = (left - mean).abs().amax(0)
    unit = torch.where(unit > 0, unit, 1.0)
    scaled = (left - mean) / unit
    means = products.mean(1)
    centred = products - means - means[:, None] + means.mean()
    spectrum, vectors = torch.linalg.eigh(centred)
    spectrum = spectrum.clamp(min=0)
    penalties = _penalties_to_try(penalty, spectrum, prior)
    chosen, residuals = least_error(spectrum, vectors, scaled, penalties)
    inverse = (vectors / (spectrum + chosen)) @ vectors.T
    dual = (inverse @ scaled) * unit
    intercepts = mean - means @ dual
    if prior is not None:
        intercepts = intercepts + prior.intercepts
    weights, scales = quantised(words.packed, dual, words.dimension, prior)
    linear = Linear(
        weights=weights,
        scales=scales,
        intercepts=intercepts,
        penalty=torch.tensor(chosen, dtype=torch.float64),
    )
    return linear, residuals * unit


def _penalties_to_try(
    penalty: float | None, spectrum: Tensor, prior: Linear | None
) -> list[float]:
    """λ of each, for eigenvalues [N] of K."""
    if prior is not None:
        return [float(prior.penalty)]
    typical = max(float(spectrum.mean()), 1.0)
    units = PENALTIES if penalty is None else (penalty,)
    return [typical * unit for unit in units]


def least_error(
    spectrum: Tensor, vectors: Tensor, targets: Tensor, penalties: list[float]
) -> tuple[float, Tensor]:
    """The penalty with the least leave-one-out error, and its residuals r_i [N, T].

    Args:
        spectrum, vectors: eigenvalues [N], not negative, and eigenvectors of the centred K.
        targets: minus their mean, float64 [N, T].
        penalties: those to try.
    """
    n = len(spectrum)
    rotated = vectors.T @ targets
    # A single frame, or only equal ones, have no leave-one-out prediction: r_i = y_i − ȳ.
    least = 1e-9 if n > 1 else 1.0
    tried = []
    for penalty in penalties:
        kept = penalty / (spectrum + penalty)
        left = ((vectors**2) @ kept - 1 / n).clamp(min=least)  # 1 − S_ii
        errors = vectors @ (kept[:, None] * rotated)
        residuals = errors / left[:, None]
        total = float((residuals**2).sum())
        tried.append((total, penalty, residuals))
    _, penalty, residuals = min(tried, key=lambda found: found[0])
    return penalty, residuals
