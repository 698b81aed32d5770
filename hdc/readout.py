"""Read-outs beside prototypes: ridge regression on the bits, and nearest frames.

Ridge regression of targets y on bits x ∈ {−1, 1}^D with an intercept,

    min over w, b of Σ_i (y_i − b − w·x_i)² + λ‖w − w₀‖²        w₀ = 0, or the weights of before,

is solved among N frames: x_i·x_k = D − 2·Hamming, and with the centred Gram matrix K the change of
the weights is Xᵀa, a = (K + λ)⁻¹(y − ȳ). One eigendecomposition of K gives every penalty and its
exact leave-one-out residuals r_i = (y_i − f(x_i))/(1 − S_ii) with S = 1/N + K(K + λ)⁻¹; the penalty
with the least Σ r_i² is taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from hdc import bits, cosine

PENALTIES = tuple(10.0**k for k in range(-4, 5))
"""Penalties tried, in units of the mean of K's diagonal."""
_OFFSET, _PLANES = 128, 8  # weights are stored as q + 128, bit-sliced
_STEP = 256  # words unpacked at a time
_ROWS = 64  # of a Gram matrix at a time


@dataclass(frozen=True)
class Ridge:
    """T linear functions of packed bits, with weights of 8 bits each.

    Attributes:
        planes: int64 [T, 8, W], bit-sliced q + 128; the weight of pixel j is scale·q_j.
        scales, intercepts: float64 [T].
        penalty: λ.
    """

    planes: Tensor
    scales: Tensor
    intercepts: Tensor
    penalty: float
    dimension: int

    def scores(self, words: Tensor, backend: str = "numpy") -> Tensor:
        """w·x + b of hypervectors int64 [Q, W], float64 [Q, T]; the products are exact."""
        n = torch.full((len(self.planes),), 2 * _OFFSET)
        products = cosine.dot(self.planes, n, words, self.dimension, backend) // 2
        return products * self.scales.to(words.device) + self.intercepts.to(words.device)

    def tensors(self) -> dict[str, Tensor]:
        """What a file has to hold."""
        penalty = torch.tensor(self.penalty, dtype=torch.float64)
        values = {"scales": self.scales, "intercepts": self.intercepts, "penalty": penalty}
        return {"weights": self.planes, **values}

    @staticmethod
    def shapes(n: int, width: int) -> dict[str, tuple[int, ...]]:
        """The shapes of :meth:`tensors`."""
        return {"weights": (n, _PLANES, width), "scales": (n,), "intercepts": (n,), "penalty": ()}

    @classmethod
    def of(cls, tensors: Mapping[str, Tensor], dimension: int) -> Ridge:
        """From :meth:`tensors`."""
        values = (tensors[name] for name in ("weights", "scales", "intercepts"))
        planes, scales, intercepts = values
        return cls(planes, scales, intercepts, float(tensors["penalty"]), dimension)

    def weights(self, start: int, stop: int) -> Tensor:
        """Weights float64 [T, B] of the bits in words start to stop."""
        shifted = bits.unpack(self.planes[..., start:stop], (stop - start) * bits.WORD)
        powers = 2.0 ** torch.arange(_PLANES, dtype=torch.float64)
        q = torch.einsum("p,tpb->tb", powers, shifted.double().cpu()) - _OFFSET
        return q * self.scales[:, None]


@dataclass(frozen=True)
class Residuals:
    """What the leave-one-out predictions of a ridge regression need besides it.

    Attributes:
        words: hypervectors of the frames, int64 [N, W].
        inverse: (K + λ)⁻¹, float64 [N, N].
        means: mean of each row of the Gram matrix, [N].
        residuals: r_i, float64 [N, T].
    """

    words: Tensor
    inverse: Tensor
    means: Tensor
    residuals: Tensor

    def changes(self, words: Tensor, dimension: int, backend: str = "numpy") -> Tensor:
        """f(x) − f₋ᵢ(x) of Q hypervectors and each frame left out, float64 [Q, N, T].

        f₋ᵢ is the fit to targets of which f₋ᵢ(x_i) replaces y_i: f(x) − f₋ᵢ(x) = S_i(x)·r_i.
        """
        products = gram(words, self.words, dimension, backend)
        centred = products - products.mean(1, keepdim=True) - (self.means - self.means.mean())
        smoother = 1 / len(self.words) + centred @ self.inverse
        return smoother[..., None] * self.residuals


def gram(a: Tensor, b: Tensor, dimension: int, backend: str = "numpy") -> Tensor:
    """Products of hypervectors in ±1, [N, W] × [M, W] → float64 [N, M] (CPU)."""
    if a is not b:
        return (dimension - 2 * bits.hamming(a, b, backend)).double().cpu()
    products = torch.empty(len(a), len(a), dtype=torch.float64)
    for start in range(0, len(a), _ROWS):  # one half; the other is its mirror image
        stop = start + _ROWS
        products[start:stop, :stop] = gram(a[start:stop], a[:stop], dimension, backend)
        products[:start, start:stop] = products[start:stop, :start].T
    return products


def ridge(
    words: Tensor,
    targets: Tensor,
    dimension: int,
    prior: Ridge | None = None,
    backend: str = "numpy",
) -> tuple[Ridge, Residuals]:
    """Fit float64 targets [N, T] to hypervectors int64 [N, W].

    Args:
        words: the hypervectors.
        targets: a column for each function.
        dimension: D.
        prior: weights to stay near, with the penalty they were fitted with; by default zero, and
            the penalty of :data:`PENALTIES` with the least leave-one-out error.
        backend: of the Gram matrix.
    """
    n = len(words)
    left = targets if prior is None else targets - prior.scores(words, backend).cpu()
    products = gram(words, words, dimension, backend)
    means = products.mean(1)
    centred = products - means - means[:, None] + means.mean()
    values, vectors = torch.linalg.eigh(centred)
    values, mean = values.clamp(min=0), left.mean(0)
    rotated = vectors.T @ (left - mean)
    unit = max(float(values.mean()), 1.0)
    best = None
    for penalty in [unit * p for p in PENALTIES] if prior is None else [prior.penalty]:
        kept = penalty / (values + penalty)
        # A single frame, or only equal ones, have no leave-one-out prediction: r_i = y_i − ȳ.
        leverage = ((vectors**2) @ kept - 1 / n).clamp(min=1e-9 if n > 1 else 1.0)
        residuals = vectors @ (kept[:, None] * rotated) / leverage[:, None]
        error = float((residuals**2).sum())
        if best is None or error < best[0]:
            best = error, penalty, residuals
    assert best is not None
    _, penalty, residuals = best
    inverse = (vectors / (values + penalty)) @ vectors.T
    dual = inverse @ (left - mean)
    intercepts = mean - means @ dual
    if prior is not None:
        intercepts = intercepts + prior.intercepts
    fitted = _quantised(words, dual, intercepts, penalty, dimension, prior)
    return fitted, Residuals(words, inverse, means, residuals)


def _quantised(
    words: Tensor,
    dual: Tensor,
    intercepts: Tensor,
    penalty: float,
    dimension: int,
    prior: Ridge | None,
) -> Ridge:
    """Weights Xᵀa, and those of before, rounded to 8 bits; a few words at a time, twice."""

    def weights(start: int) -> Tensor:
        part = words[:, start : start + _STEP].cpu()
        signs = bits.unpack(part, part.shape[1] * bits.WORD).double()
        total = dual.T @ (2 * signs - 1)
        return total if prior is None else total + prior.weights(start, start + part.shape[1])

    starts = range(0, words.shape[1], _STEP)
    largest = torch.stack([weights(start).abs().amax(1) for start in starts]).amax(0)
    scales = torch.where(largest > 0, largest / (_OFFSET - 1), 1.0)
    planes = words.new_zeros(dual.shape[1], _PLANES, words.shape[1])
    for start in starts:
        q = (weights(start) / scales[:, None]).round().long() + _OFFSET
        q[:, max(0, dimension - start * bits.WORD) :] = 0
        for p in range(_PLANES):
            packed = bits.pack((q >> p) & 1 == 1).to(words.device)
            planes[:, p, start : start + packed.shape[1]] = packed
    return Ridge(planes, scales, intercepts, penalty, dimension)


def nearest(distances: np.ndarray, k: int) -> np.ndarray:
    """Indices [Q, k] of the smallest of distances [Q, N], nearest first, of equal ones in order."""
    return np.argsort(distances, axis=1, kind="stable")[:, :k]
