"""Integer prototypes: the counts themselves, compared by the cosine with bipolar queries."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from hdc import bits
from hdc.prototypes import Counters


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
    """‖2c − n‖ of each class, correctly rounded; see :func:`scores` for `size`."""
    lengths = []
    for planes, n in zip(counters.planes, counters.n.tolist(), strict=True):
        total, square = moments(planes)
        length = 4 * square - 4 * n * total + n * n * counters.dimension
        if size is not None and 1 < n > size:
            # n·D + Σ_{i≠k} x_i·x_k = ‖s‖², and the mean product of a pair is that of a subset's.
            diagonal = n * counters.dimension
            pairs = (length - diagonal) * size * (size - 1) / (n * (n - 1))
            lengths.append(math.sqrt(max(0.0, size * counters.dimension + pairs)) * n / size)
        else:
            lengths.append(math.sqrt(length))
    return lengths


def scores(counters: Counters, words: Tensor, size: int | None = None) -> Tensor:
    """Minus √D times the cosine of queries int64 [Q, W] and 2c − n: float64 [Q, L].

    Smaller is nearer. Classes that are equally near may differ by rounding.

    Args:
        counters: the counts c and numbers of samples n of L classes.
        words: the queries.
        size: a class of more samples is compared as a random subset of so many is expected to be;
            by default all samples count.

    Raises:
        ValueError: for counts so large that 64 bits do not hold their products.
    """
    if counters.n.max() >= 2**60 // counters.dimension:
        raise ValueError(f"counters: expected fewer samples, found {int(counters.n.max())}")
    lengths = torch.tensor(norms(counters, size), dtype=torch.float64, device=words.device)
    return -dot(counters.planes, counters.n, words, counters.dimension) / lengths.clamp(min=1)


def dot(planes: Tensor, n: Tensor, words: Tensor, dimension: int, backend: str = "numpy") -> Tensor:
    """(2v − 1)·(2c − n) of queries v, int64 [Q, L], from bit-sliced c, int64 [L, P, W].

    A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ plane_p| and |v ∧ b| = (|v| + |b| − Ham(v, b))/2.
    """
    n_classes, n_planes, width = planes.shape
    weights = 2 ** torch.arange(n_planes, device=words.device)
    ones, plane_ones = bits.count_ones(words), bits.count_ones(planes)
    distances = bits.hamming(words, planes.reshape(-1, width), backend)
    distances = distances.view(-1, n_classes, n_planes)
    overlap = (ones[:, None, None] + plane_ones - distances) // 2
    products, total = (overlap * weights).sum(2), (plane_ones * weights).sum(1)
    return 4 * products - 2 * total - n.to(words.device) * (2 * ones[:, None] - dimension)
