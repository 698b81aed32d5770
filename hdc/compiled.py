"""The inner loops on the CPU as machine code: encoding 8-bit frames, counting, distances.

Imported only for ``backend="compiled"``: numba takes as long to import as everything else here. The
results are those of the numpy routes, bit for bit. The first import on a machine compiles (some
seconds) and keeps the code beside this file, in the user's cache folder, or in this process only.

One operation is spelled out for LLVM, which does not find it by itself: a comparison of 64 bytes
whose outcome is one word of mask. It passes a frame of 500 × 500 in 6 µs; a plain loop over pixels
takes 44 µs, and one over words of eight pixels 23 µs (one core of an AMD EPYC, Zen 4). Counting is
plain loops over words, of which LLVM makes vectors.

Work is shared among `torch.get_num_threads()` threads of Python; numba lets go of the interpreter
meanwhile, and no second runtime of threads competes with torch's.
"""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import torch
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

_WORD = 64
_BLOCK = (
    512  # words a row counted at a time: counters and rows of a block stay in the cache
)
_SHARE_BYTES = 2**17  # of input that are worth another thread
_TRIALS = 4  # of levels that a sample proposes


def encode_uint8(images: np.ndarray, words: np.ndarray) -> list[int]:
    """Fill words [N, ⌈D/64⌉] with the hypervectors of images [N, D ≥ 2]; return constant frames."""
    constant = np.zeros(len(images), np.bool_)
    images = np.ascontiguousarray(images)

    def work(start: int, stop: int) -> None:
        _encode(images, np.arange(start, stop), words[start:stop], constant, 127)

    _share(work, len(images), images.nbytes)
    return np.flatnonzero(constant).tolist()


def count_uint8(
    images: np.ndarray,
    counts: np.ndarray,
    order: np.ndarray,
    ends: np.ndarray,
    places: np.ndarray,
    kept: np.ndarray,
) -> list[int]:
    """:func:`encode_uint8` and :func:`count_into` in one read; return constant frames.

    The hypervector of image i is written to row places[i] of `kept` [K, W], or, with −1, nowhere.
    """
    constant = np.zeros(len(images), np.bool_)
    images = np.ascontiguousarray(images)
    shared: list[
        tuple[int, np.ndarray]
    ] = []  # counts of a class that another thread began

    def work(start: int, stop: int) -> None:
        first = int(np.searchsorted(ends, start, "right"))
        for c in range(first, int(np.searchsorted(ends, stop, "left")) + 1):
            left, right = (
                max(start, int(ends[c - 1]) if c else 0),
                min(stop, int(ends[c])),
            )
            if left == right:
                continue
            into = counts[c : c + 1]
            if left == start > (ends[c - 1] if c else 0):
                into = np.zeros_like(into)
                shared.append((c, into))
            _encode_and_count(images, order[left:right], into, places, kept, constant)

    _share(work, len(images), images.nbytes)
    for c, part in shared:
        _add(counts[c], part[0])
    return np.flatnonzero(constant).tolist()


def count_into(
    counts: np.ndarray, words: np.ndarray, order: np.ndarray, ends: np.ndarray
) -> None:
    """Add rows of words [N, W] to bit-sliced counters [L, P, W], in place, all classes at once.

    `order` has row numbers, class by class; the rows of class c end at ends[c] of it.
    """
    words = np.ascontiguousarray(words)

    def work(start: int, stop: int) -> None:
        _count(counts, words, order, ends, start * _BLOCK, stop * _BLOCK)

    _share(work, -(-words.shape[1] // _BLOCK), len(order) * words.shape[1] * 8)


def hamming(queries: np.ndarray, prototypes: np.ndarray) -> np.ndarray:
    """Hamming distances int64 [Q, L] of words [Q, W] and [L, W]."""
    distances = np.empty((len(queries), len(prototypes)), np.int64)

    def work(start: int, stop: int) -> None:
        _hamming(queries[start:stop], prototypes, distances[start:stop])

    _share(work, len(queries), queries.nbytes * max(1, len(prototypes)))
    return distances


def _share(work: Callable[[int, int], object], n: int, n_bytes: int) -> None:
    """work(start, stop) on consecutive pieces of range(n), one a thread."""
    n_threads = max(1, min(torch.get_num_threads(), n, n_bytes // _SHARE_BYTES))
    cuts = [n * i // n_threads for i in range(n_threads + 1)]
    pool = _pool(os.getpid())
    others = [pool.submit(work, *cut) for cut in itertools.pairwise(cuts[1:])]
    work(0, cuts[1])
    for other in others:
        other.result()


@functools.cache
def _pool(process: int) -> ThreadPoolExecutor:
    """Threads of this process; a forked one has the pool of its parent but not its threads."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="compiled")


# Operations for LLVM -----------------------------------------------------------------------------

_operation: Any = (
    intrinsic  # its type says that it leaves the function's arguments as they are
)


def _compare(relation: str):
    """An intrinsic (pixels, row, start, level) → the mask of 64 pixels, the first one lowest."""

    @_operation
    def compare(typing_context, pixels, row, start, level):
        def code(context, builder, signature, arguments):
            pixels, row, start, level = arguments
            view = context.make_array(signature.args[0])(context, builder, pixels)
            place = cgutils.get_item_pointer(
                context, builder, signature.args[0], view, (row, start)
            )  # without a check of bounds
            vector = ir.VectorType(ir.IntType(8), _WORD)
            block = builder.load(builder.bitcast(place, vector.as_pointer()), align=1)
            i32 = ir.IntType(32)
            one = builder.insert_element(
                ir.Constant(vector, ir.Undefined), level, i32(0)
            )
            zeros = ir.Constant(ir.VectorType(i32, _WORD), None)
            levels = builder.shuffle_vector(one, one, zeros)
            mask = builder.icmp_unsigned(relation, block, levels)
            return builder.bitcast(mask, ir.IntType(_WORD))

        return types.uint64(pixels, types.intp, types.intp, types.uint8), code

    return compare


_greater = _compare(">")
_equal = _compare("==")


@_operation
def _ones(typing_context, word):
    """The number of ones of a word."""

    def code(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return types.int64(types.uint64), code


# Kernels -----------------------------------------------------------------------------------------


def _compile(signature):
    """numba's njit, which keeps the machine code where a folder can be written."""

    def compiled(function):
        try:
            return njit(signature, nogil=True, cache=True)(function)
        except (RuntimeError, OSError):
            return njit(signature, nogil=True)(function)

    return compiled


@_compile(
    "UniTuple(int64, 2)(uint8[:, ::1], intp, uint8, int64[::1], int64[::1], boolean)"
)
def _threshold(images, i, level, words, sample, sampled):
    """Fill words [W] with the pixels above a level; return how many there are, and how many equal.

    Where it is to be `sampled`, one pixel of each word is counted in sample [256].
    """
    whole, rest = divmod(images.shape[1], _WORD)
    n_greater = n_equal = 0
    for w in range(whole):
        greater = _greater(images, i, w * _WORD, level)
        words[w] = np.int64(greater)
        n_greater += _ones(greater)
        n_equal += _ones(_equal(images, i, w * _WORD, level))
        if sampled:  # at a place that differs, lest the sample follow a pattern
            place = (w * 0x9E37_79B1 >> 8) % _WORD
            sample[images[i, w * _WORD + place]] += 1
    if rest:
        word = np.int64(0)
        for j in range(rest):
            pixel = images[i, whole * _WORD + j]
            word |= np.int64(pixel > level) << j
            n_equal += pixel == level
        words[whole] = word
        n_greater += _ones(np.uint64(word))
    return n_greater, n_equal


@_compile("void(uint8[:, ::1], intp, uint8, int64[::1], int64)")
def _add_ties(images, i, level, words, missing):
    """Add the first `missing` pixels that equal the level to words [W]."""
    whole = images.shape[1] // _WORD
    w = 0
    while missing > 0 and w < whole:
        ties = np.int64(_equal(images, i, w * _WORD, level))
        n = _ones(np.uint64(ties))
        if n > missing:  # leave the lowest ones alone
            rest = ties
            for _ in range(missing):
                rest &= rest - 1
            ties ^= rest
        words[w] |= ties
        missing -= n
        w += 1
    j = whole * _WORD
    while missing > 0:
        if images[i, j] == level:
            words[whole] |= np.int64(1) << (j - whole * _WORD)
            missing -= 1
        j += 1


@_compile("uint8(uint8[:, ::1], int64[::1], int64[:, ::1], boolean[::1], uint8)")
def _encode(images, rows, words, constant, level):
    """:func:`encode_uint8` of some rows of images, in one thread; return the level of the last.

    The level of the frame before is tried first, in one pass over the frame. Then the counts of all
    pixels say how many are too many or too few above it, and a sample which level has as many. What
    neither finds in some trials is found by halving.
    """
    dimension = images.shape[1]
    ones = dimension // 2
    level = np.int64(level)
    sample = np.zeros(256, np.int64)
    for k in range(len(rows)):
        i = rows[k]
        sample[:] = 0
        low, high, trials = 0, 255, 0
        while True:
            n_greater, n_equal = _threshold(
                images, i, np.uint8(level), words[k], sample, trials == 0
            )
            trials += 1
            if n_greater > ones:
                low = level + 1
                surplus = n_greater - ones - sample[low] * _WORD
                level = low
                while surplus > 0 and level < high:
                    level += 1
                    surplus -= sample[level] * _WORD
            elif n_greater + n_equal < ones:
                high = level - 1
                missing = ones - n_greater - n_equal - sample[high] * _WORD
                level = high
                while missing > 0 and level > low:
                    level -= 1
                    missing -= sample[level] * _WORD
            else:
                break
            if trials > _TRIALS:
                level = (low + high) // 2
        _add_ties(images, i, np.uint8(level), words[k], ones - n_greater)
        constant[i] = n_equal == dimension
    return np.uint8(level)


@_compile("UniTuple(int64, 2)(int64, int64, int64)")
def _full_adder(a, b, c):
    """Sum and carry of three bits at every position."""
    half = a ^ b
    return half ^ c, (a & b) | (half & c)


@_compile("void(int64[:, :, ::1], int64[:, ::1], int64[::1], int64[::1], int64, int64)")
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


_EIGHT = 8  # hypervectors that _count takes at once; their words stay in the cache


@_compile(
    "void(uint8[:, ::1], int64[::1], int64[:, :, ::1], int64[::1], int64[:, ::1], boolean[::1])"
)
def _encode_and_count(images, rows, counts, places, kept, constant):
    """:func:`count_uint8` of images of one class, with counts [1, P, W], in one thread."""
    words = np.empty((_EIGHT, counts.shape[2]), np.int64)
    order, ends = np.arange(_EIGHT), np.empty(1, np.int64)
    level = np.uint8(127)
    for start in range(0, len(rows), _EIGHT):
        eight = rows[start : start + _EIGHT]
        level = _encode(images, eight, words, constant, level)
        for k in range(len(eight)):
            if places[eight[k]] >= 0:
                kept[places[eight[k]]] = words[k]
        ends[0] = len(eight)
        _count(counts, words, order, ends, 0, counts.shape[2])


@_compile("void(int64[:, ::1], int64[:, ::1])")
def _add(counts, others):
    """Add bit-sliced counts [P, W] to others, in place."""
    for w in range(counts.shape[1]):
        carry = np.int64(0)
        for p in range(counts.shape[0]):
            counts[p, w], carry = _full_adder(counts[p, w], others[p, w], carry)


@_compile("void(int64[:, ::1], int64[:, ::1], int64[:, ::1])")
def _hamming(queries, prototypes, distances):
    """:func:`hamming` in one thread."""
    for i in range(len(queries)):
        for j in range(len(prototypes)):
            total = np.int64(0)
            for w in range(queries.shape[1]):
                total += _ones(np.uint64(queries[i, w] ^ prototypes[j, w]))
            distances[i, j] = total
