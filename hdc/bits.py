"""Packed bits in torch: 64 bits in an int64, on any device. Useful on its own.

A hypervector of D bits is W = ⌈D/64⌉ int64 words; bit j is bit j mod 64 (least significant first)
of word j // 64, and the bits of the last word above D are zero. On the CPU, where torch has no
population count, numpy's is used, with the same results bit for bit.

>>> import torch
>>> from hdc import bits
>>> masks = torch.tensor([[True, False, True], [True, True, True], [False, False, True]])
>>> words = bits.pack(masks)
>>> words.tolist(), bits.count_ones(words).tolist()
([[5], [7], [4]], [2, 3, 1])
>>> bits.hamming(words, words).tolist()
[[0, 1, 1], [1, 0, 2], [1, 2, 0]]
>>> bits.unpack(bits.majority(words), 3).tolist()
[True, False, True]
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch import Tensor

from hdc import backends, planes

WORD = planes.WORD

# Eight bools seen as one int64 times this constant carry their bits into the top byte, in order.
_GATHER_BYTE = 0x0102040810204080
_GRAM_ROWS = 64  # of a Gram matrix at a time
_UNPACKED_WORDS = 64  # at a time; their floats stay in the cache

if sys.byteorder != "little":  # the byte views below would put bits elsewhere
    raise ImportError(
        "hdc.bits: expected a little-endian machine, found a big-endian one"
    )


def words_for(dimension: int) -> int:
    """W, the number of 64-bit words that hold D bits."""
    return -(-dimension // WORD)


def pack(mask: Tensor) -> Tensor:
    """Pack bool [..., D] into int64 words [..., ⌈D/64⌉]; the inverse of :func:`unpack`.

    >>> pack(torch.tensor([True, False, True]))
    tensor([5])
    """
    if mask.dtype != torch.bool:
        raise TypeError(f"mask: expected dtype torch.bool, found {mask.dtype}")
    *batch, dimension = mask.shape
    width = words_for(dimension)
    if mask.device.type != "cpu":
        padded = mask.new_zeros(*batch, width * WORD)
        padded[..., :dimension] = mask
        top_bytes = (padded.view(torch.int64) * _GATHER_BYTE) >> 56
        return top_bytes.to(torch.uint8).view(torch.int64)
    bytes_ = np.packbits(mask.numpy(), axis=-1, bitorder="little")
    words = np.zeros((*batch, width), np.int64)
    n_bytes = bytes_.shape[-1]
    words.view(np.uint8)[..., :n_bytes] = bytes_
    return torch.from_numpy(words)


def unpack(words: Tensor, dimension: int) -> Tensor:
    """Unpack int64 words [..., W] into bool [..., D].

    Raises:
        TypeError: for words of another type.
        ValueError: for another number of words than D bits have.
    """
    check_width(words, dimension)
    if words.device.type != "cpu":
        shifts = torch.arange(WORD).to(words)
        separate = (words.unsqueeze(-1) >> shifts) & 1
        return separate.flatten(-2)[..., :dimension].bool()
    bytes_ = words.contiguous().numpy().view(np.uint8)
    ones = np.unpackbits(bytes_, axis=-1, count=dimension, bitorder="little")
    return torch.from_numpy(ones.view(np.bool_))


def count_ones(words: Tensor) -> Tensor:
    """Number of ones of each hypervector: int64 [..., W] to int64 [...].

    Raises:
        TypeError: for words of another type.
    """
    _check_words("count_ones", words)
    if words.device.type == "cpu":
        # Of signed words numpy counts the magnitude.
        ones = np.bitwise_count(words.numpy().view(np.uint64))
        return torch.from_numpy(np.asarray(ones.sum(-1, dtype=np.int64)))
    return _swar_popcount(words).sum(-1)


def hamming(queries: Tensor, prototypes: Tensor) -> Tensor:
    """Hamming distances (paper, Eq. 2) between all pairs: [Q, W] × [L, W] → int64 [Q, L].

    Raises:
        TypeError: for words of another type than int64.
        ValueError: if the two do not have the same number of words.
    """
    _check_words("hamming", queries, prototypes)
    asked_width, width = queries.shape[-1], prototypes.shape[-1]
    if asked_width != width:
        raise ValueError(
            f"hamming: expected equal widths, found {asked_width} and {width} words"
        )
    return _weighted_hamming(queries, prototypes[:, None])


def _weighted_hamming(words: Tensor, counts: Tensor) -> Tensor:
    """Σ_p 2^p Ham(v, b_p) of queries [Q, W] and planes [L, P, W]: int64 [Q, L]."""
    n_classes, n_planes, width = counts.shape
    kernels = backends.in_use.get()
    if kernels:
        asked = words.contiguous().numpy()
        known = counts.contiguous().numpy()
        return torch.from_numpy(kernels.weighted_hamming(asked, known))
    on_cpu = words.device.type == "cpu"
    measure = _hamming_by_numpy if on_cpu else _hamming_by_torch
    distances = measure(words, counts.reshape(-1, width))
    if n_planes == 1:
        return distances
    weights = 2 ** torch.arange(n_planes, device=words.device)
    return (distances.view(-1, n_classes, n_planes) * weights).sum(2)


def _hamming_by_torch(queries: Tensor, prototypes: Tensor) -> Tensor:
    distances = queries.new_empty(len(queries), len(prototypes))
    step = max(1, 2**23 // max(1, prototypes.numel()))  # at most about 256 MB
    for start in range(0, len(queries), step):
        differing = queries[start : start + step, None] ^ prototypes
        distances[start : start + step] = _swar_popcount(differing).sum(-1)
    return distances


def _hamming_by_numpy(queries: Tensor, prototypes: Tensor) -> Tensor:
    asked = queries.contiguous().numpy().view(np.uint64)
    known = prototypes.contiguous().numpy().view(np.uint64)
    distances = np.empty((len(asked), len(known)), np.int64)
    # Some tens of queries a step keep the intermediate words in the processor's cache.
    step = max(1, 2**16 // max(1, asked.shape[1]))
    for start in range(0, len(asked), step):
        block = asked[start : start + step]
        for j, prototype in enumerate(known):
            column = distances[start : start + step, j]
            np.bitwise_count(block ^ prototype).sum(-1, out=column)
    return torch.from_numpy(distances)


def _swar_popcount(words: Tensor) -> Tensor:
    """Population count by adding neighbouring fields (Warren, Hacker's Delight, 5-1).

    Torch shifts int64 arithmetically, so every shift is followed by a mask that clears the sign.
    """
    words = words - ((words >> 1) & 0x5555555555555555)
    words = (words & 0x3333333333333333) + ((words >> 2) & 0x3333333333333333)
    words = (words + (words >> 4)) & 0x0F0F0F0F0F0F0F0F
    return ((words * 0x0101010101010101) >> 56) & 0x7F


# Products ----------------------------------------------------------------------------------------


def dot(counts: Tensor, n: Tensor, words: Tensor, dimension: int) -> Tensor:
    """(2v − 1)·(2c − n) of queries v, int64 [Q, L], from bit-sliced c, int64 [L, P, W].

    A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ b_p| of the planes b_p, and 2|v ∧ b| = |v| + |b| −
    Ham(v, b), so that |b_p| cancels:
    (2v − 1)·(2c − n) = 2·((2^P − 1 − n)·|v| − Σ_p 2^p Ham(v, b_p)) + n·D.
    """
    largest = 2 ** counts.shape[1] - 1
    n = n.to(words.device)
    ones = count_ones(words)[:, None]
    distances = _weighted_hamming(words, counts)
    return 2 * ((largest - n) * ones - distances) + n * dimension


def shifted_dot(weights: Tensor, shift: int, words: Tensor, dimension: int) -> Tensor:
    """(2v − 1)·q of queries v and whole weights q, bit-sliced as q + shift: int64 [Q, L]."""
    n = torch.full((len(weights),), 2 * shift)
    return dot(weights, n, words, dimension) // 2


def gram(a: Tensor, b: Tensor, dimension: int) -> Tensor:
    """Products of hypervectors in ±1, [N, W] × [M, W] → float64 [N, M] (CPU)."""
    if a is not b:
        distances = hamming(a, b)
        return (dimension - 2 * distances).double().cpu()
    products = torch.empty(len(a), len(a), dtype=torch.float64)

    def fill(start: int) -> None:  # one triangle, and its mirror image
        stop = start + _GRAM_ROWS
        block = gram(a[start:stop], a[:stop], dimension)
        products[start:stop, :stop] = block
        products[:start, start:stop] = block[:, :start].T

    starts = reversed(range(0, len(a), _GRAM_ROWS))  # the longest first
    if backends.in_use.get() is None and a.device.type == "cpu":
        # Kernels and a GPU have threads of their own; numpy has none.
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
    sums = torch.empty(factors.shape[1], width * WORD)
    for start in range(0, width, _UNPACKED_WORDS):
        stop = min(start + _UNPACKED_WORDS, width)
        n_bits = (stop - start) * WORD
        ones = unpack(words[:, start:stop], n_bits).float()
        sums[:, start * WORD : stop * WORD] = factors.T @ ones
    return sums


def sliced(numbers: Tensor, n_planes: int) -> Tensor:
    """Planes int64 [..., P, W] of whole numbers [..., D], at least zero and below 2^P."""
    made = [pack(numbers >> p & 1 == 1) for p in range(n_planes)]
    return torch.stack(made, -2)


def numbers_of(counts: Tensor, dimension: int) -> Tensor:
    """The whole numbers int64 [L, D] of planes [L, P, W]."""
    total = counts.new_zeros(len(counts), dimension)
    for p in range(counts.shape[1]):
        total += unpack(counts[:, p], dimension).long() << p
    return total


# Bundles -----------------------------------------------------------------------------------------


def majority(words: Tensor, ties: str = "zero") -> Tensor:
    """Bitwise majority (paper, Eq. 1) of N hypervectors: int64 [N, W] → [W].

    Args:
        words: the hypervectors to bundle.
        ties: what a bit with as many ones as zeros (even N) becomes: ``"zero"`` or ``"one"``.

    Raises:
        TypeError: for words of another type than int64.
        ValueError: for no hypervectors, or an unknown rule.
    """
    _check_words("majority", words)
    if len(words) == 0:
        raise ValueError("majority: expected at least one hypervector, found none")
    of_one_class = torch.zeros(len(words), dtype=torch.int64)
    return planes.majorities(*planes.counted(words, of_one_class, 1), ties)[0]


def where(mask: Tensor, ones: Tensor, zeros: Tensor) -> Tensor:
    """Bits of `ones` at the ones of a mask, and of `zeros` at its zeros, of words [..., W] alike.

    >>> where(torch.tensor([3]), torch.tensor([5]), torch.tensor([8])).tolist()
    [9]
    """
    return zeros ^ ((zeros ^ ones) & mask)


def random_hypervector(
    dimension: int, seed: int, p: float = 0.5, stream: tuple[int, ...] = ()
) -> Tensor:
    """D independent bits that are one with probability p: int64 [W].

    Each pair of a `seed`, any integer, and a `stream`, non-negative integers, gives its own bits.
    """
    source = np.random.PCG64(seed_sequence(seed, stream))
    # A double has 53 random bits, and so has p.
    drawn = source.random_raw(dimension) >> np.uint64(11)
    is_one = drawn < round(p * 2**53)
    return pack(torch.from_numpy(is_one))


def seed_sequence(seed: int, stream: tuple[int, ...]) -> np.random.SeedSequence:
    """numpy's seed sequence for a stream and any integer seed, also a negative one."""
    not_negative = 2 * abs(int(seed))
    if seed < 0:
        not_negative -= 1
    return np.random.SeedSequence(not_negative, spawn_key=stream)


# Checks -------------------------------------------------------------------------------------------


def _check_words(name: str, *tensors: Tensor) -> None:
    """Raise TypeError for tensors that are not of packed words."""
    for words in tensors:
        if words.dtype != torch.int64:
            found = str(words.dtype).removeprefix("torch.")
            raise TypeError(f"{name}: expected packed words of int64, found {found}")


def check_width(words: Tensor, dimension: int) -> None:
    """Raise ValueError for hypervectors [..., W] of other words than D bits have, and TypeError for
    words of another type than int64."""
    _check_words("words", words)
    found = words.shape[-1]
    width = words_for(dimension)
    if found != width:
        raise ValueError(
            f"words: expected {width} words for D = {dimension}, found {found}"
        )


def check_padding(words: Tensor, dimension: int) -> None:
    """Raise ValueError for hypervectors [..., W] with a one beyond bit D of the last word."""
    used = dimension % WORD
    if used and (words[..., -1] >> used).any():
        raise ValueError(
            f"words: expected zeros beyond D = {dimension} bits, found ones"
        )
