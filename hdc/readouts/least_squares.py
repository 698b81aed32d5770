"""Ridge regression of targets y on bits x ∈ {−1, 1}^D with an intercept,

    min over w, b of Σ_i (y_i − b − w·x_i)² + λ‖w − w₀‖²        w₀ = 0, or the weights of before,

solved among N frames: x_i·x_k = D − 2·Hamming, and with the centred Gram matrix K the change of
the weights is Xᵀa, a = (K + λ)⁻¹(y − ȳ). One eigendecomposition of K gives every penalty and its
exact leave-one-out residuals r_i = (y_i − f(x_i))/(1 − S_ii) with S = 1/N + K(K + λ)⁻¹; the penalty
with the least Σ r_i² is taken. If there are more frames than bits, the D × D scatter C = Xᵀ·X of
the centred bits is decomposed: the change of the weights is (C + λ)⁻¹Xᵀ(y − ȳ), and
S = 1/N + X(C + λ)⁻¹Xᵀ.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import NamedTuple, Self

import torch
from torch import Tensor

from hdc import bits
from hdc.bits import gram
from hdc.hypervectors import Hypervectors
from hdc.readouts.among_bits import in_parts, scatter, signs
from hdc.readouts.discriminant import check_memory
from hdc.readouts.linear import Linear, quantised, weights_of

PENALTIES = tuple(10.0**k for k in range(-4, 5))
"""Penalties tried, in units of the mean of K's diagonal."""


def solve(
    words: Hypervectors,
    targets: Tensor,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> tuple[Linear, Tensor]:
    """Linear functions fitted to targets, and their leave-one-out residuals r [N, T].

    Args:
        words: N hypervectors.
        targets: float64 [N, T].
        penalty: λ in units of the mean of K's diagonal; None tries :data:`PENALTIES`.
        prior: weights w₀, whose λ is used again.

    Raises:
        ValueError: for more than 8000 frames of more than 8000 bits, for which the products of all
            pairs, of frames or of bits, are too large.
    """
    dimension = words.dimension
    check_memory("ridge", min(len(words), dimension), "frames or bits")
    left = targets
    if prior is not None:
        left = targets - prior.values(words).cpu()
    mean = left.mean(0)
    # Squares of numbers near 1e155 or 1e-165 would overflow or vanish.
    unit = (left - mean).abs().amax(0)
    unit = torch.where(unit > 0, unit, 1.0)
    scaled = (left - mean) / unit
    solve_among = _among_bits if len(words) > dimension else _among_frames
    to_try = functools.partial(_penalties_to_try, penalty, prior)
    found = solve_among(words, scaled, unit, to_try)
    weights, intercepts = found.weights, mean - found.at_mean
    if prior is not None:
        weights = weights + prior.floats()
        intercepts = intercepts + prior.intercepts
    planes, scales = quantised(weights, dimension)
    linear = Linear(
        weights=planes.to(words.packed.device),
        scales=scales,
        intercepts=intercepts,
        penalty=torch.tensor(found.penalty, dtype=torch.float64),
    )
    return linear, found.residuals * unit


def _penalties_to_try(
    penalty: float | None, prior: Linear | None, typical: float
) -> list[float]:
    """Values of λ, given the mean of K's diagonal."""
    if prior is not None:
        return [float(prior.penalty)]
    typical = max(typical, 1.0)
    units = PENALTIES if penalty is None else (penalty,)
    return [typical * unit for unit in units]


class Found(NamedTuple):
    """The fit with the penalty of the least leave-one-out error."""

    penalty: float
    residuals: Tensor  # r_i in the unit of the targets, float64 [N, T]
    weights: Tensor  # w, float64 [T, 64·W]
    at_mean: Tensor  # w·x̄, float64 [T]


def _among_frames(
    words: Hypervectors,
    targets: Tensor,
    unit: Tensor,
    to_try: Callable[[float], list[float]],
) -> Found:
    """Fit by the products of all pairs of frames.

    Args:
        words: N hypervectors.
        targets: targets minus their mean, divided by their unit, float64 [N, T].
        unit: unit of the targets, [T].
        to_try: function of the mean of K's diagonal that gives the penalties to try.
    """
    products = gram(words.packed, words.packed, words.dimension)
    means = products.mean(1)
    centred = products - means - means[:, None] + means.mean()
    spectrum, vectors = torch.linalg.eigh(centred)
    spectrum = spectrum.clamp(min=0)
    penalties = to_try(float(spectrum.mean()))
    chosen, residuals = least_error(spectrum, vectors, targets, penalties)
    inverse = (vectors / (spectrum + chosen)) @ vectors.T
    dual = (inverse @ targets) * unit
    return Found(chosen, residuals, weights_of(dual, words.packed), means @ dual)


def least_error(
    spectrum: Tensor, vectors: Tensor, targets: Tensor, penalties: list[float]
) -> tuple[float, Tensor]:
    """The penalty with the least leave-one-out error, and its residuals r_i [N, T].

    Args:
        spectrum, vectors: eigenvalues [N], not negative, and eigenvectors of K.
        targets: targets minus their mean, float64 [N, T].
        penalties: values of λ to try.
    """
    n = len(spectrum)
    rotated = vectors.T @ targets
    # A single frame has no leave-one-out prediction: r_i = y_i − ȳ.
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


def _among_bits(
    words: Hypervectors,
    targets: Tensor,
    unit: Tensor,
    to_try: Callable[[float], list[float]],
) -> Found:
    """Fit by the products of all pairs of bits; arguments as in :func:`_among_frames`."""
    n, width = words.packed.shape
    products, mean = _scatter(words)
    spectrum, vectors = torch.linalg.eigh(products)
    spectrum = spectrum.clamp(min=0)
    rights = torch.zeros(len(mean), len(unit), dtype=torch.float64)
    for part, x in _centred(words, mean):
        rights.addmm_(x.T, targets[part])
    rotated = vectors.T @ rights
    inverses = {one: 1 / (spectrum + one) for one in to_try(float(spectrum.sum()) / n)}
    residuals = {one: torch.empty_like(targets) for one in inverses}
    for part, x in _centred(words, mean):
        along = x @ vectors
        for one, inverse in inverses.items():
            left = 1 - 1 / n - along**2 @ inverse  # 1 − S_ii
            errors = targets[part] - along @ (inverse[:, None] * rotated)
            residuals[one][part] = errors / left.clamp(min=1e-9)[:, None]
    chosen = min(residuals, key=lambda one: float((residuals[one] ** 2).sum()))
    weights = (vectors @ (inverses[chosen][:, None] * rotated) * unit).T
    whole = torch.zeros(len(unit), width * bits.WORD, dtype=torch.float64)
    whole[:, : len(mean)] = weights
    return Found(chosen, residuals[chosen], whole, weights @ mean)


def smoother_of(words: Hypervectors, penalty: float) -> Dual | Primal:
    """The smoother of N training frames for a penalty λ."""
    kind = Primal if len(words) > words.dimension else Dual
    return kind.of(words, penalty)


class Dual(NamedTuple):
    """The smoother S(x) of the fit among frames, for leave-one-out predictions of new frames.

    In double precision, since with few frames and a small penalty three digits of single precision
    remain.
    """

    words: Hypervectors
    inverse: Tensor  # (K + λ)⁻¹, float64 [N, N]
    means: Tensor  # of the rows of the Gram matrix, [N]

    @classmethod
    def of(cls, words: Hypervectors, penalty: float) -> Self:
        products = gram(words.packed, words.packed, words.dimension)
        means = products.mean(1)
        products -= means
        products -= means[:, None] - means.mean()
        products.diagonal().add_(penalty)
        factor = torch.linalg.cholesky(products)
        return cls(words, torch.cholesky_inverse(factor), means)

    def of_queries(self, words: Hypervectors) -> Tensor:
        """S_i(x) of Q frames: float64 [Q, N]."""
        products = gram(words.packed, self.words.packed, words.dimension)
        shift = self.means - self.means.mean()
        own_means = products.mean(1, keepdim=True)
        centred = products - own_means - shift
        return 1 / len(self.means) + centred @ self.inverse


class Primal(NamedTuple):
    """The smoother :class:`Dual` of more frames than bits, among the bits."""

    words: Hypervectors
    inverse: Tensor  # (C + λ)⁻¹, float64 [D, D]
    mean: Tensor  # of the frames in ±1, [D]

    @classmethod
    def of(cls, words: Hypervectors, penalty: float) -> Self:
        products, mean = _scatter(words)
        products.diagonal().add_(penalty)
        factor = torch.linalg.cholesky(products)
        return cls(words, torch.cholesky_inverse(factor), mean)

    def of_queries(self, words: Hypervectors) -> Tensor:
        """S_i(x) of Q frames: float64 [Q, N]."""
        along = (signs(words) - self.mean) @ self.inverse
        each = [along @ x.T for _, x in _centred(self.words, self.mean)]
        return 1 / len(self.words) + torch.cat(each, 1)


def _scatter(words: Hypervectors) -> tuple[Tensor, Tensor]:
    """C, float64 [D, D], and the mean [D] of the frames in ±1."""
    of_one_class = torch.zeros(len(words), dtype=torch.int64)
    products, means = scatter(words, of_one_class)
    return products, means[0]


def _centred(words: Hypervectors, mean: Tensor) -> Iterator[tuple[slice, Tensor]]:
    """Slices of frames, and their bits in ±1 minus the mean, float64 [B, D]."""
    for part in in_parts(words):
        yield part, signs(words[part]) - mean
