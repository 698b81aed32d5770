"""Counting and comparing hypervectors: plain loops over words, of which LLVM makes vectors."""

from __future__ import annotations

import numpy as np

from hdc.compiled.operations import compile_kernel, ones, share

_BLOCK = 512
"""Words a row counted at a time: they stay in the cache with their counters."""


def count_into(
    counts: np.ndarray, words: np.ndarray, order: np.ndarray, ends: np.ndarray
) -> None:
    """Add rows of words [N, W] to bit-sliced counters [L, P, W], in place, all classes at once.

    `order` has row numbers, class by class; the rows of class c end at ends[c] of it.
    """
    words = np.ascontiguousarray(words)

    def work(start: int, stop: int) -> None:
        _count(counts, words, order, ends, start * _BLOCK, stop * _BLOCK)

    width = words.shape[1]
    n_blocks = -(-width // _BLOCK)
    share(work, n_blocks, n_bytes=len(order) * width * 8)


def weighted_hamming(queries: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Σ_p 2^p·Ham(v, b_p) of queries v [Q, W] and planes b_p [L, P, W]: int64 [Q, L]."""
    distances = np.zeros((len(queries), len(planes)), np.int64)

    def some_queries(start: int, stop: int) -> None:
        _hamming(queries[start:stop], planes, distances[start:stop])

    def some_classes(start: int, stop: int) -> None:
        _hamming(queries, planes[start:stop], distances[:, start:stop])

    work = some_queries if len(queries) >= len(planes) else some_classes
    n_bytes = queries.nbytes * max(1, len(planes) * planes.shape[1])
    share(work, max(distances.shape), n_bytes)
    return distances


# Kernels -----------------------------------------------------------------------------------------


@compile_kernel("UniTuple(int64, 2)(int64, int64, int64)")
def _full_adder(a, b, c):
    """Sum and carry of three bits at every position."""
    half = a ^ b
    return half ^ c, (a & b) | (half & c)


@compile_kernel(
    "void(int64[:, :, ::1], int64[:, ::1], int64[::1], int64[::1], int64, int64)"
)
def _count(counts, words, order, ends, start, stop):
    """:func:`count_into` for words start to stop, in one thread.

    Rows of weight 2^p, two at a time, and the counter's own plane p make rows of weight 2^(p+1):
    eight rows become one of weight 8, which runs through the other planes, as single rows do.
    """
    carry = np.empty(_BLOCK, np.int64)
    stop = min(stop, words.shape[1])
    for left in range(start, stop, _BLOCK):
        right = min(left + _BLOCK, stop)
        first = 0
        for c in range(len(ends)):
            while first < ends[c]:
                if first + 8 <= ends[c]:
                    r0 = words[order[first], left:right]
                    r1 = words[order[first + 1], left:right]
                    r2 = words[order[first + 2], left:right]
                    r3 = words[order[first + 3], left:right]
                    r4 = words[order[first + 4], left:right]
                    r5 = words[order[first + 5], left:right]
                    r6 = words[order[first + 6], left:right]
                    r7 = words[order[first + 7], left:right]
                    ones = counts[c, 0, left:right]
                    twos = counts[c, 1, left:right]
                    fours = counts[c, 2, left:right]
                    for i in range(right - left):
                        one, two_a = _full_adder(ones[i], r0[i], r1[i])
                        one, two_b = _full_adder(one, r2[i], r3[i])
                        one, two_c = _full_adder(one, r4[i], r5[i])
                        ones[i], two_d = _full_adder(one, r6[i], r7[i])
                        two, four_a = _full_adder(twos[i], two_a, two_b)
                        twos[i], four_b = _full_adder(two, two_c, two_d)
                        fours[i], carry[i] = _full_adder(fours[i], four_a, four_b)
                    first, p = first + 8, 3
                else:
                    carry[: right - left] = words[order[first], left:right]
                    first, p = first + 1, 0
                while p < counts.shape[1]:
                    plane = counts[c, p, left:right]
                    for i in range(right - left):
                        old = plane[i]
                        plane[i] = old ^ carry[i]
                        carry[i] &= old
                    p += 1


@compile_kernel("void(int64[:, ::1], int64[:, :, ::1], int64[:, :])")
def _hamming(queries, planes, distances):
    """Add :func:`weighted_hamming` to distances, in one thread.

    A block of words at a time: the words of a class stay in the first-level cache, and the queries
    in the next.
    """
    width = queries.shape[1]
    for left in range(0, width, _BLOCK):
        right = min(left + _BLOCK, width)
        for j in range(len(planes)):
            for i in range(len(queries)):
                query = queries[i, left:right]
                total = np.int64(0)
                for p in range(planes.shape[1]):
                    plane = planes[j, p, left:right]
                    differing = np.int64(0)
                    for w in range(right - left):
                        differing += ones(np.uint64(query[w] ^ plane[w]))
                    total += differing << p
                distances[i, j] += total
