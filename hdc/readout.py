"""Read-outs beside binary prototypes: the counts themselves, and ridge regression on the bits.

Integer prototypes are the counts c of n frames, compared by the cosine of 2c − n and a query.

Ridge regression of targets y on bits x ∈ {−1, 1}^D with an intercept,

    min over w, b of Σ_i (y_i − b − w·x_i)² + λ‖w − w₀‖²        w₀ = 0, or the weights of before,

is solved among N frames: x_i·x_k = D − 2·Hamming, and with the centred Gram matrix K the change of
the weights is Xᵀa, a = (K + λ)⁻¹(y − ȳ). One eigendecomposition of K gives every penalty and its
exact leave-one-out residuals r_i = (y_i − f(x_i))/(1 − S_ii) with S = 1/N + K(K + λ)⁻¹; the penalty
with the least Σ r_i² is taken.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from hdc import bits
from hdc.prototypes import Counters

PENALTIES = tuple(10.0**k for k in range(-4, 5))
"""Penalties tried, in units of the mean of K's diagonal."""
_OFFSET, _PLANES = 128, 8  # weights are stored as q + 128, bit-sliced
_STEP = 256  # words unpacked at a time
_ROWS = 64  # of a Gram matrix at a time


def dot(
    planes: Tensor,
    plane_ones: Tensor,
    n: Tensor,
    words: Tensor,
    dimension: int,
    backend: str = "numpy",
) -> Tensor:
    """(2v − 1)·(2c − n) of queries v, int64 [Q, L], from bit-sliced c, int64 [L, P, W].

    A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ plane_p| and |v ∧ b| = (|v| + |b| − Ham(v, b))/2;
    `plane_ones` [L, P] are the |plane_p|.
    """
    n_classes, n_planes, width = planes.shape
    weights = 2 ** torch.arange(n_planes, device=words.device)
    ones = bits.count_ones(words)
    distances = bits.hamming(words, planes.reshape(-1, width), backend)
    distances = distances.view(-1, n_classes, n_planes)
    overlap = (ones[:, None, None] + plane_ones - distances) // 2
    products, total = (overlap * weights).sum(2), (plane_ones * weights).sum(1)
    return (
        4 * products - 2 * total - n.to(words.device) * (2 * ones[:, None] - dimension)
    )


def moments(planes: Tensor) -> tuple[int, int]:
    """Σ_j c_j and Σ_j c_j² of bit-sliced counts [P, W], in integers.

    c² = Σ_p Σ_q 2^(p+q) b_p b_q, and the sum of b_p b_q over j is a count of ones.
    """
    first = second = 0
    for p, plane in enumerate(planes):
        ones = bits.count_ones(plane & planes[p:]).tolist()
        first += ones[0] << p
        second += ones[0] << 2 * p
        second += sum(n << (2 * p + k + 1) for k, n in enumerate(ones[1:], 1))
    return first, second


def norms(counters: Counters, size: int | None = None) -> list[float]:
    """‖2c − n‖ of each class, correctly rounded; see :func:`cosines` for `size`."""
    lengths = []
    for planes, n in zip(counters.planes, counters.n.tolist(), strict=True):
        total, square = moments(planes)
        length = 4 * square - 4 * n * total + n * n * counters.dimension
        if size is not None and 1 < n > size:
            # n·D + Σ_{i≠k} x_i·x_k = ‖s‖², and the mean product of a pair is that of a subset's.
            diagonal = n * counters.dimension
            pairs = (length - diagonal) * size * (size - 1) / (n * (n - 1))
            lengths.append(
                math.sqrt(max(0.0, size * counters.dimension + pairs)) * n / size
            )
        else:
            lengths.append(math.sqrt(length))
    return lengths


def cosines(counters: Counters, words: Tensor, size: int | None = None) -> Tensor:
    """Minus √D times the cosine of queries int64 [Q, W] and 2c − n: float64 [Q, L].

    A class of more than `size` samples is compared as a random subset of so many is expected to be.

    Raises:
        ValueError: for counts so large that 64 bits do not hold their products.
    """
    if counters.n.max() >= 2**60 // counters.dimension:
        raise ValueError(
            f"counters: expected fewer samples, found {int(counters.n.max())}"
        )
    lengths = torch.tensor(
        norms(counters, size), dtype=torch.float64, device=words.device
    )
    ones = bits.count_ones(counters.planes)
    products = dot(counters.planes, ones, counters.n, words, counters.dimension)
    return -products / lengths.clamp(min=1)


@dataclass(frozen=True)
class Ridge:
    """T linear functions of packed bits, with weights of 8 bits each: scale·q_j for pixel j."""

    planes: Tensor  # int64 [T, 8, W], bit-sliced q + 128
    scales: Tensor  # float64 [T]
    intercepts: Tensor  # float64 [T]
    penalty: float  # λ
    dimension: int

    def scores(self, words: Tensor, backend: str = "numpy") -> Tensor:
        """w·x + b of hypervectors int64 [Q, W], float64 [Q, T]; the products are exact."""
        n = torch.full((len(self.planes),), 2 * _OFFSET)
        products = dot(self.planes, self._ones, n, words, self.dimension, backend) // 2
        return products * self.scales.to(words.device) + self.intercepts.to(
            words.device
        )

    @functools.cached_property
    def _ones(self) -> Tensor:
        return bits.count_ones(self.planes)

    def tensors(self) -> dict[str, Tensor]:
        """The tensors of a file."""
        penalty = torch.tensor(self.penalty, dtype=torch.float64)
        values = {
            "scales": self.scales,
            "intercepts": self.intercepts,
            "penalty": penalty,
        }
        return {"weights": self.planes, **values}

    @staticmethod
    def shapes(n: int, width: int) -> dict[str, tuple[int, ...]]:
        """The shapes of :meth:`tensors`."""
        return {
            "weights": (n, _PLANES, width),
            "scales": (n,),
            "intercepts": (n,),
            "penalty": (),
        }

    @classmethod
    def of(cls, tensors: Mapping[str, Tensor], dimension: int) -> Ridge:
        """From :meth:`tensors`."""
        weights, scales, intercepts, penalty = (
            tensors[name] for name in cls.shapes(0, 0)
        )
        return cls(weights, scales, intercepts, float(penalty), dimension)

    def weights(self, start: int, stop: int) -> Tensor:
        """Weights float64 [T, B] of the bits in words start to stop."""
        shifted = bits.unpack(self.planes[..., start:stop], (stop - start) * bits.WORD)
        powers = 2.0 ** torch.arange(_PLANES, dtype=torch.float64)
        q = torch.einsum("p,tpb->tb", powers, shifted.double().cpu()) - _OFFSET
        return q * self.scales[:, None]


@dataclass(frozen=True)
class Residuals:
    """What the leave-one-out predictions of a ridge regression need besides it."""

    words: Tensor  # hypervectors of the frames, int64 [N, W]
    inverse: Tensor  # (K + λ)⁻¹, float64 [N, N]
    means: Tensor  # of each row of the Gram matrix, [N]
    residuals: Tensor  # r_i, float64 [N, T]

    def changes(self, words: Tensor, dimension: int, backend: str = "numpy") -> Tensor:
        """f(x) − f₋ᵢ(x) of Q hypervectors and each frame left out, float64 [Q, N, T].

        f₋ᵢ is the fit to targets of which f₋ᵢ(x_i) replaces y_i: f(x) − f₋ᵢ(x) = S_i(x)·r_i.
        """
        products = gram(words, self.words, dimension, backend)
        centred = (
            products - products.mean(1, keepdim=True) - (self.means - self.means.mean())
        )
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
    """Fit float64 targets [N, T] to hypervectors int64 [N, W] of D bits.

    Weights stay near those of a `prior`, with its penalty; by default near zero, with the penalty
    of :data:`PENALTIES` that has the least leave-one-out error.
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
    intercepts = mean - means @ dual + (0 if prior is None else prior.intercepts)
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
        return (
            total
            if prior is None
            else total + prior.weights(start, start + part.shape[1])
        )

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
