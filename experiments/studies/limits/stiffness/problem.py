"""Penalised softmax regression as a stiff problem, in pixel space and float64.

    F(W) = 1/N Σᵢ −log softmax(W·xᵢ)[yᵢ] + λ/2·‖W‖²,        W: L × D, no intercept.

Softmax does not change when all classes get the same weights, and no frame changes what is
orthogonal to all frames. From zero weights every method stays in the rest, the identifiable
subspace. There the Hessian has the condition number κ = (λ_max + λ)/(λ_min + λ), with λ_max and
λ_min those of the mean cross-entropy at the optimum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh, null_space
from scipy.special import log_softmax

Array = NDArray[np.floating]
Evaluate = Callable[[Array], tuple[Any, Array]]  # the loss keeps the precision

_RANK = 1e-12  # singular values of the frames, relative: below, they are rounding


@dataclass(frozen=True)
class Problem:
    """The frames, their classes and the strength of the penalty.

    Attributes:
        x: frames, float64 [N, D].
        onehot: their classes, float64 [N, L].
        strength: λ.
    """

    x: Array
    onehot: Array
    strength: float

    def evaluate(
        self,
        weights: Array,
    ) -> tuple[Any, Array]:
        """F and its gradient [L, D] at weights [L, D], in the precision of the weights."""
        x = self.x.astype(weights.dtype, copy=False)
        log_p = log_softmax(x @ weights.T, axis=1)
        fit = -(self.onehot * log_p).sum() / len(x)
        residual = np.exp(log_p) - self.onehot
        gradient = residual.T @ x / len(x) + self.strength * weights
        return fit + self.strength / 2 * (weights**2).sum(), gradient

    @property
    def bound(self) -> float:
        """Largest eigenvalue that the Hessian has anywhere: ½·σ²/N + λ (Böhning, 1992)."""
        largest = float(np.linalg.norm(self.x, 2))
        return 0.5 * largest**2 / len(self.x) + self.strength

    @property
    def start(self) -> Array:
        """Zero weights [L, D]."""
        return np.zeros((self.onehot.shape[1], self.x.shape[1]))


def contrasts(classes: int) -> Array:
    """Orthonormal basis [L, L − 1] of what tells classes apart: it sums to zero over them."""
    return null_space(np.ones((1, classes)))


def curvature(x: Array, basis: Array, weights: Array) -> Array:
    """Hessian of the mean cross-entropy in coordinates, [K·R, K·R], in the precision of the
    weights: basis [L, K] of classes, frames x [N, R] and weights [L, R] in a basis of pixels."""
    x = x.astype(weights.dtype, copy=False)
    p = np.exp(log_softmax(x @ weights.T, axis=1))
    mixed = p @ basis
    (n, r), k = x.shape, basis.shape[1]
    hessian = np.empty((k, r, k, r), weights.dtype)
    for i in range(k):
        for j in range(i + 1):
            joint = p @ (basis[:, i] * basis[:, j]) - mixed[:, i] * mixed[:, j]
            block = (x.T * (joint / n)) @ x
            hessian[i, :, j] = hessian[j, :, i] = block
    return hessian.reshape(k * r, k * r)


def condition(problem: Problem, weights: Array) -> float:
    """κ of the identifiable subspace at weights [L, D]."""
    _, singular, directions = np.linalg.svd(problem.x, full_matrices=False)
    spanned = directions[singular > _RANK * singular[0]].T
    basis = contrasts(len(weights))
    hessian = curvature(problem.x @ spanned, basis, weights @ spanned)
    values = eigvalsh(hessian).clip(min=0) + problem.strength
    return float(values[-1] / values[0])
