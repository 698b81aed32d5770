"""Mean correlations over pairs of samples, Eqs. 4 to 6 of the paper, without their double sums.

A frame minus its mean, divided by its norm, is z with Σ z = 0 and Σ z² = 1, and the correlation of
two frames is the product z·z′. With the class sums S_l = Σ_k z_lk the mean of Eqs. 4 and 5,

    C_ll′ = Σ_k Σ_{k′≠k} z_lk·z_l′k′ / M = (S_l·S_l′ − Σ_k z_lk·z_l′k) / M,   M = N_s(N_s − 1),

takes O(N·D) instead of O(N²·D) operations; pairs with k = k′ are left out on and off the diagonal,
as in the paper. Eq. 6 is z(P_l)·S_l′/N_s for a prototype P_l. All sums are in float64.

The correlation with a frame of zero variance is not defined: it is NaN, and so is every mean it
belongs to; such frames are counted.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray


@dataclass
class CorrelationSums:
    """Sums behind the mean correlations of L classes; without arguments, of no samples.

    Attributes:
        n: N_s, samples of each class.
        sums: S, float64 [L, D].
        same: Σ_k z_lk·z_l′k, float64 [L, L].
        undefined: samples of each class without variance, int64 [L].
    """

    n: int = 0
    sums: Any = 0.0
    same: Any = 0.0
    undefined: Any = 0

    @classmethod
    def of(cls, samples: Any, dtype: DTypeLike = np.float64) -> Self:
        """Make the sums of one sample of each class, [L, D].

        Args:
            samples: of any real or integer type.
            dtype: of the standardised samples: float64, or float32, which rounds each once.
        """
        z = standardise(samples, dtype)
        undefined = np.isnan(z[:, 0]).astype(np.int64)
        return cls(1, z.astype(np.float64), (z @ z.T).astype(np.float64), undefined)

    def __add__(self, other: CorrelationSums) -> CorrelationSums:
        """The sums of both sets of samples."""
        both = map(operator.add, vars(self).values(), vars(other).values())
        return CorrelationSums(*both)

    def pair_means(self) -> NDArray[np.float64]:
        """C_ll′ of Eqs. 4 and 5, float64 [L, L]; of two samples per class at least."""
        if self.n < 2:
            raise ValueError(
                f"samples: expected at least two of each class, found {self.n}"
            )
        of_pairs: NDArray[np.float64] = self.sums @ self.sums.T - self.same
        return of_pairs / (self.n * (self.n - 1))

    def means_with(self, prototypes: Any) -> NDArray[np.float64]:
        """C_ll′ of Eq. 6, float64 [P, L]: prototypes [P, D] with the samples of each class."""
        means: NDArray[np.float64] = standardise(prototypes) @ self.sums.T / self.n
        return means


def mean_pair_correlations(
    a: Any,
    b: Any,
    dtype: DTypeLike = np.float64,
) -> float:
    """C_ll′ of Eqs. 4 and 5 for two classes in O(N_s·D) operations and O(D) memory.

    Args:
        a, b: samples [N_s, D] of class l and l′, of any real or integer type; the same array twice
            for the diagonal element C_ll. NaN if one has no variance.
        dtype: see :meth:`CorrelationSums.of`.
    """
    pairs = map(np.stack, zip(a, b, strict=True))
    each = (CorrelationSums.of(pair, dtype) for pair in pairs)
    return float(sum(each, CorrelationSums()).pair_means()[0, 1])


def pair_correlations_double_sum(
    a: Any, b: Any, dtype: DTypeLike = np.float64
) -> float:
    """:func:`mean_pair_correlations` pair by pair as Eq. 4 is written, in `dtype`: O(N_s²·D)."""
    if _constant(a).any() or _constant(b).any():
        return np.nan
    x, y = a.astype(dtype), b.astype(dtype)
    n, total = len(x), 0.0
    for k in range(n):
        for other in (*range(k), *range(k + 1, n)):
            one, two = x[k], y[other]
            product = (one - one.mean()) * (two - two.mean())
            total += float(product.mean() / (one.std() * two.std()))
    return total / (n * (n - 1))


def standardise(samples: Any, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Samples [N, D] minus their means, divided by their norms; NaN for one without variance, or
    with a value that is not finite."""
    samples = np.asarray(samples)
    constant = _constant(samples)
    x = samples.astype(np.float64)
    # Twice: a mean 10⁶ times the deviation leaves a rounded part of itself behind.
    x -= x.mean(1, keepdims=True)
    x -= x.mean(1, keepdims=True)
    scale = np.abs(x).max(1)  # squares of very large or small values over- or underflow
    scale[constant] = np.nan  # never a division by a rounding error
    x /= scale[:, None]
    norm = np.sqrt(np.einsum("nd,nd->n", x, x))
    x /= norm[:, None]
    return x.astype(dtype, copy=False)


def contrast(correlation: NDArray[np.float64]) -> float:
    """ΔC = max_ll′ |C_ll − C_ll′| of a matrix [L, L]."""
    within = np.diag(correlation)[:, None]
    return float(np.abs(within - correlation).max())


def _constant(samples: NDArray[Any]) -> NDArray[np.bool_]:
    return samples.max(1) == samples.min(1)
