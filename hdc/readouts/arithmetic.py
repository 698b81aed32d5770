"""Products of packed hypervectors with bit-sliced weights, and with each other, in integers."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import torch
from torch import Tensor

from hdc import backends, bits
from hdc.hypervectors import Hypervectors

MOST_FRAMES = 8000
"""Training frames of a read-out that is solved by the products of all pairs."""
_ROWS = 64  # of a Gram matrix at a time
_STEP = 64  # words unpacked at a time; their floats stay in the cache
_SIGNS = 2**20  # bits that are floats at a time, for sums over frames


def check_memory(
    readout: str, n: int, matrices: int, dimension: int | None = None
) -> None:
    """Raise ValueError for more frames than the products of all pairs have room for.

    Args:
        readout: its name, for the error.
        n: training frames.
        matrices: float64 [n, n] that are held at a time.
        dimension: D, of a read-out that takes the products of all pairs of bits where D < n.
    """
    size = n if dimension is None else min(n, dimension)
    if size <= MOST_FRAMES:
        return
    expected, found, fewer = (
        f"{MOST_FRAMES} frames",
        f"{n}",
        "fewer frames of each class",
    )
    if dimension is not None:
        expected += f" or {MOST_FRAMES} bits"
        found += f" frames of {dimension} bits"
        fewer += ", or on fewer pixels (--subsample)"
    memory = matrices * 8 * size**2 / 1e9
    raise ValueError(
        f"{readout}: expected at most {expected}, found {found}, which need {matrices} matrices "
        f"of {size} × {size}, {memory:.1f} GB; train on {fewer}, or use a read-out without such "
        "a matrix, such as 'neighbours'"
    )


def dot(planes: Tensor, n: Tensor, words: Tensor, dimension: int) -> Tensor:
    """(2v − 1)·(2c − n) of queries v, int64 [Q, L], from bit-sliced c, int64 [L, P, W].

    A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ b_p| of the planes b_p, and 2|v ∧ b| = |v| + |b| −
    Ham(v, b), so that |b_p| cancels:
    (2v − 1)·(2c − n) = 2·((2^P − 1 − n)·|v| − Σ_p 2^p Ham(v, b_p)) + n·D.
    """
    largest = 2 ** planes.shape[1] - 1
    n = n.to(words.device)
    ones = bits.count_ones(words)[:, None]
    distances = _weighted_hamming(words, planes)
    return 2 * ((largest - n) * ones - distances) + n * dimension


def _weighted_hamming(words: Tensor, planes: Tensor) -> Tensor:
    """Σ_p 2^p Ham(v, b_p) of queries [Q, W] and planes [L, P, W]: int64 [Q, L]."""
    n_classes, n_planes, width = planes.shape
    kernels = backends.in_use.get()
    if kernels:
        asked = words.contiguous().numpy()
        known = planes.contiguous().numpy()
        return torch.from_numpy(kernels.weighted_hamming(asked, known))
    distances = bits.hamming(words, planes.reshape(-1, width))
    weights = 2 ** torch.arange(n_planes, device=words.device)
    return (distances.view(-1, n_classes, n_planes) * weights).sum(2)


def gram(a: Tensor, b: Tensor, dimension: int) -> Tensor:
    """Products of hypervectors in ±1, [N, W] × [M, W] → float64 [N, M] (CPU)."""
    if a is not b:
        distances = bits.hamming(a, b)
        return (dimension - 2 * distances).double().cpu()
    products = torch.empty(len(a), len(a), dtype=torch.float64)

    def fill(start: int) -> None:  # one half; the other is its mirror image
        stop = start + _ROWS
        block = gram(a[start:stop], a[:stop], dimension)
        products[start:stop, :stop] = block
        products[:start, start:stop] = block[:, :start].T

    starts = reversed(range(0, len(a), _ROWS))  # the longest first
    if backends.in_use.get() is None and a.device.type == "cpu":
        # The kernels have threads of their own, and so has a GPU; numpy has none.
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            list(pool.map(fill, starts))
    else:
        for start in starts:
            fill(start)
    return products


def combinations(coefficients: Tensor, words: Tensor) -> Tensor:
    """Σ_i a_ik·x_i of hypervectors int64 [N, W] in ±1, a [N, K]: float32 [K, 64·W] (CPU).

    Bits beyond D count as −1. Sums of whole numbers are exact below 2²⁴; others are rounded in an
    order that differs between backends, processors and numbers of threads.
    """
    factors = coefficients.float()
    here = words.cpu()
    kernels = backends.in_use.get()
    if kernels:
        sums = torch.from_numpy(kernels.combine(here.numpy(), factors.numpy()))
    else:
        sums = _sums_of_ones(factors, here)
    return sums.mul_(2).sub_(factors.sum(0)[:, None])


def _sums_of_ones(factors: Tensor, words: Tensor) -> Tensor:
    """Σ_i a_ik·v_i of hypervectors [N, W] in {0, 1}: float32 [K, 64·W]."""
    width = words.shape[1]
    sums = torch.empty(factors.shape[1], width * bits.WORD)
    for start in range(0, width, _STEP):
        stop = min(start + _STEP, width)
        n_bits = (stop - start) * bits.WORD
        ones = bits.unpack(words[:, start:stop], n_bits).float()
        sums[:, start * bits.WORD : stop * bits.WORD] = factors.T @ ones
    return sums


# Sums over frames that outnumber their bits -------------------------------------------------------


def signs(words: Hypervectors) -> Tensor:
    """The bits in ±1, float64 [N, D] (CPU)."""
    ones = bits.unpack(words.packed.cpu(), words.dimension)
    return ones.double().mul_(2).sub_(1)


def in_parts(words: Hypervectors) -> Iterator[slice]:
    """Rows of hypervectors that are unpacked at a time."""
    step = max(1, _SIGNS // words.dimension)
    for start in range(0, len(words), step):
        yield slice(start, start + step)


def scatter(words: Hypervectors, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Σ (x − μ)·(x − μ)ᵀ of all frames in ±1 and the means μ of their classes, and these means.

    Sums are whole numbers, exact below 2⁵³, up to one division for each class.

    Args:
        words: N hypervectors.
        rows: their classes int64 [N] (CPU), each of 0 … L − 1 with a frame.

    Returns:
        float64 [D, D] and [L, D] (CPU).
    """
    size = words.dimension
    total = torch.zeros(size, size, dtype=torch.float64)
    means = []
    for c in range(int(rows.max()) + 1):
        of_class = words[rows == c]
        n = len(of_class)
        products = torch.zeros_like(total)
        sums = torch.zeros(size, dtype=torch.float64)
        for part in in_parts(of_class):
            x = signs(of_class[part])
            products.addmm_(x.T, x)
            sums += x.sum(0)
        total += products.mul_(n).addr_(sums, sums, alpha=-1).div_(n)
        means.append(sums / n)
    return total, torch.stack(means)
