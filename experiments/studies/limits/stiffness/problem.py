"""Penalised softmax regression as a stiff problem, in pixel space and float64.

    F(W, b) = 1/N Σᵢ −log softmax(W·xᵢ + b)[yᵢ] + λ/2·‖W‖²,        b not penalised.

A weight vector of a class holds its intercept last; to every frame a one is appended.

Frames are centred: what all of them share makes no problem stiff that has an intercept. Stiff are
frames that nearly repeat one of m others, whatever their class: what tells them apart is a part ε
of what it was, and a penalty of the order of ε² leaves the classifier to be found in just that.

Softmax does not change when all classes get the same weights, and no frame changes what is
orthogonal to all frames. From zero weights every method stays in the rest, the identifiable
subspace. There the Hessian has the condition number κ, of its eigenvalues at the optimum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

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
        x: centred frames and a one, float64 [N, D + 1].
        onehot: their classes, float64 [N, L].
        strength: λ.
    """

    x: Array
    onehot: Array
    strength: float

    @classmethod
    def of(
        cls, frames: Array, onehot: Array, strength: float, apart: float, originals: int
    ) -> Self:
        """From frames [N, D]: all but the first `originals` keep this part of how they differ from
        one of those. Then they are centred, and scaled to a mean square of their norms of one."""
        original = frames[np.arange(len(frames)) % originals]
        nearly = original + apart * (frames - original)
        centred = nearly - nearly.mean(0)
        scaled = centred / np.sqrt((centred**2).sum(1).mean())
        return cls(np.column_stack([scaled, np.ones(len(frames))]), onehot, strength)

    def evaluate(self, weights: Array) -> tuple[Any, Array]:
        """F and its gradient [L, D + 1] at weights [L, D + 1], in the precision of the weights."""
        x = self.x.astype(weights.dtype, copy=False)
        log_p = log_softmax(x @ weights.T, axis=1)
        fit = -(self.onehot * log_p).sum() / len(x)
        residual = np.exp(log_p) - self.onehot
        gradient = residual.T @ x / len(x) + self.penalty * weights
        return fit + (self.penalty * weights**2).sum() / 2, gradient

    @cached_property
    def penalty(self) -> Array:
        """λ of each weight of a class, none of its intercept: [D + 1]."""
        return np.append(np.full(self.x.shape[1] - 1, self.strength), 0.0)

    @property
    def bound(self) -> float:
        """Largest eigenvalue that the Hessian has anywhere: ½·σ²/N + λ (Böhning, 1992)."""
        largest = float(np.linalg.norm(self.x, 2))
        return 0.5 * largest**2 / len(self.x) + self.strength

    @property
    def start(self) -> Array:
        """Zero weights [L, D + 1]."""
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
    """κ of the identifiable subspace at weights [L, D + 1]."""
    _, singular, directions = np.linalg.svd(problem.x, full_matrices=False)
    spanned = directions[singular > _RANK * singular[0]].T
    basis = contrasts(len(weights))
    hessian = curvature(problem.x @ spanned, basis, weights @ spanned)
    # Frames are centred: the intercept is a direction of its own.
    penalty = (spanned**2).T @ problem.penalty
    hessian.flat[:: len(hessian) + 1] += np.tile(penalty, basis.shape[1])
    values = eigvalsh(hessian)
    return float(values[-1] / max(values[0], problem.strength))
