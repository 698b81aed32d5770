"""The inner loops on the CPU as machine code: encoding 8-bit frames, and counting hypervectors.

Imported only where ``backend="compiled"`` is asked for, because numba takes as long to import as
everything else here together. The results are those of the numpy routes, bit for bit. The first
import on a machine compiles (some seconds) and keeps the code beside this file, or in the user's
cache folder, or, where neither can be written, only for this process.

Two operations are spelled out for LLVM, which finds neither by itself: a comparison of 64 bytes
whose outcome is one word of mask, and a carry-save adder tree over vectors of words. Both are
defined on any processor; those with masks or wide registers need few instructions for them.

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
_LANES = 8  # words of a vector
_ROWS = 8  # rows that one pass over the counters adds
_BLOCK = 512  # words a row counted at a time: counters and rows of a block stay in the cache
_SHARE_BYTES = 2**17  # of input that are worth another thread
_AHEAD = 8192  # bytes: the processor's own prefetching ends with a page
_SAMPLE = 1024  # pixels from which the first frame's level is guessed


def encode_uint8(images: np.ndarray, words: np.ndarray) -> list[int]:
    """Fill words [N, ⌈D/64⌉] with the hypervectors of images [N, D ≥ 2]; return constant frames."""
    constant = np.zeros(len(images), np.bool_)
    images = np.ascontiguousarray(images)
    _share(
        lambda start, stop: _encode(images[start:stop], words[start:stop], constant[start:stop]),
        len(images),
        images.nbytes,
    )
    return np.flatnonzero(constant).tolist()


def count_into(counts: np.ndarray, words: np.ndarray, order: np.ndarray, ends: np.ndarray) -> None:
    """Add rows of words [N, W] to bit-sliced counters [L, P, W], in place, all classes at once.

    Args:
        order: row numbers, class by class.
        ends: int64 [L], where in `order` the rows of each class end.
    """
    words = np.ascontiguousarray(words)
    n_blocks = -(-words.shape[1] // _BLOCK)
    _share(
        lambda start, stop: _count(counts, words, order, ends, start * _BLOCK, stop * _BLOCK),
        n_blocks,
        len(order) * words.shape[1] * 8,
    )


def _share(work: Callable[[int, int], object], n: int, n_bytes: int) -> None:
    """work(start, stop) on consecutive pieces of range(n); every thread takes the next one."""
    n_threads = max(1, min(torch.get_num_threads(), n, n_bytes // _SHARE_BYTES))
    if n_threads == 1:
        work(0, n)
        return
    # More pieces than threads: one whose core is also wanted by others does fewer.
    n_pieces = min(n, 4 * n_threads)
    turn = itertools.count()

    def take() -> None:
        while (i := next(turn)) < n_pieces:
            work(n * i // n_pieces, n * (i + 1) // n_pieces)

    pool = _pool(os.getpid(), n_threads - 1)
    others = [pool.submit(take) for _ in range(n_threads - 1)]
    take()
    for other in others:
        if not other.cancel():  # it has begun
            other.result()


@functools.cache
def _pool(process: int, n_threads: int) -> ThreadPoolExecutor:
    """Threads of this process; a forked one has the pool of its parent but not its threads."""
    return ThreadPoolExecutor(n_threads, thread_name_prefix="compiled")


# Operations for LLVM -----------------------------------------------------------------------------

_operation: Any = intrinsic  # its type says that it leaves the function's arguments as they are


def _pointer(context, builder, array_type, array, *index):
    """Where an element of a C-contiguous array lies; index without a check of bounds."""
    view = context.make_array(array_type)(context, builder, array)
    return cgutils.get_item_pointer(context, builder, array_type, view, index)


def _load(builder, pointer, lanes, bits):
    vector = ir.VectorType(ir.IntType(bits), lanes)
    return builder.load(builder.bitcast(pointer, vector.as_pointer()), align=1)


def _compare(relation: str):
    """An intrinsic (pixels, row, start, level) → the mask of 64 pixels, the first one lowest."""

    @_operation
    def compare(typing_context, pixels, row, start, level):
        def code(context, builder, signature, arguments):
            pixels, row, start, level = arguments
            place = _pointer(context, builder, signature.args[0], pixels, row, start)
            block = _load(builder, place, _WORD, 8)
            one = builder.insert_element(ir.Constant(block.type, ir.Undefined), level,
                                         ir.Constant(ir.IntType(32), 0))  # fmt: skip
            zeros = ir.Constant(ir.VectorType(ir.IntType(32), _WORD), None)
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


@_operation
def _prefetch(typing_context, pixels, row, start):
    """Ask for the cache line of a pixel; a hint, so the pixel need not exist."""

    def code(context, builder, signature, arguments):
        place = _pointer(context, builder, signature.args[0], *arguments)
        i32 = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, i32, i32, i32])
        prefetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(prefetch, [place, i32(0), i32(2), i32(1)])  # to read, to the second level
        return context.get_dummy_value()

    return types.void(pixels, types.intp, types.intp), code


def _add_rows(n_rows: int):
    """An intrinsic (counts, c, words, order, first, place): add rows to class c at eight words."""

    @_operation
    def add(typing_context, counts, c, words, order, first, place):
        def code(context, builder, signature, arguments):
            counts, c, words, order, first, place = arguments
            counts_type, _, words_type, order_type, _, _ = signature.args
            vectors = []
            for i in range(n_rows):
                at = builder.add(first, ir.Constant(first.type, i))
                row = builder.load(_pointer(context, builder, order_type, order, at))
                source = _pointer(context, builder, words_type, words, row, place)
                vectors.append(_load(builder, source, _LANES, _WORD))
            # Rows of weight 2^p, with the counter's own plane p, make rows of weight 2^(p+1).
            p = 0
            while (1 << p) < n_rows:
                plane = _pointer(context, builder, counts_type, counts, c,
                                 ir.Constant(c.type, p), place)  # fmt: skip
                total, carries = _load(builder, plane, _LANES, _WORD), []
                for a, b in zip(vectors[::2], vectors[1::2], strict=True):
                    half = builder.xor(total, a)
                    carries.append(builder.or_(builder.and_(total, a), builder.and_(half, b)))
                    total = builder.xor(half, b)
                builder.store(total, builder.bitcast(plane, total.type.as_pointer()), align=1)
                vectors, p = carries, p + 1
            # The last carry runs through the other planes.
            carry = cgutils.alloca_once_value(builder, vectors[0])
            view = context.make_array(counts_type)(context, builder, counts)
            n_planes = builder.extract_value(view.shape, 1)
            with cgutils.for_range(builder, n_planes, start=ir.Constant(c.type, p)) as loop:
                plane = _pointer(context, builder, counts_type, counts, c, loop.index, place)
                old, new = _load(builder, plane, _LANES, _WORD), builder.load(carry)
                total = builder.xor(old, new)
                builder.store(total, builder.bitcast(plane, total.type.as_pointer()), align=1)
                builder.store(builder.and_(old, new), carry)
            return context.get_dummy_value()

        return types.void(counts, types.intp, words, order, types.intp, types.intp), code

    return add


_add_one_row = _add_rows(1)
_add_some_rows = _add_rows(_ROWS)


# Kernels -----------------------------------------------------------------------------------------


def _compile(signature):
    """numba's njit, which keeps the machine code where a folder can be written."""

    def compiled(function):
        try:
            return njit(signature, nogil=True, cache=True)(function)
        except (RuntimeError, OSError):
            return njit(signature, nogil=True)(function)

    return compiled


@_compile("UniTuple(int64, 2)(uint8[:, ::1], intp, uint8, int64[:, ::1])")
def _threshold(images, i, level, words):
    """Fill row i with the pixels above a level; return how many there are, and how many equal."""
    whole, rest = divmod(images.shape[1], _WORD)
    n_greater = n_equal = 0
    for w in range(whole):
        _prefetch(images, i, w * _WORD + _AHEAD)
        greater = _greater(images, i, w * _WORD, level)
        words[i, w] = np.int64(greater)
        n_greater += _ones(greater)
        n_equal += _ones(_equal(images, i, w * _WORD, level))
    if rest:
        word = np.int64(0)
        for j in range(rest):
            pixel = images[i, whole * _WORD + j]
            word |= np.int64(pixel > level) << j
            n_equal += pixel == level
        words[i, whole] = word
        n_greater += _ones(np.uint64(word))
    return n_greater, n_equal


@_compile("void(uint8[:, ::1], intp, uint8, int64[:, ::1], int64)")
def _add_ties(images, i, level, words, missing):
    """Add the first `missing` pixels that equal the level to row i."""
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
        words[i, w] |= ties
        missing -= n
        w += 1
    j = whole * _WORD
    while missing > 0:
        if images[i, j] == level:
            words[i, whole] |= np.int64(1) << (j - whole * _WORD)
            missing -= 1
        j += 1


@_compile("uint8(uint8[:, ::1])")
def _sampled_level(images):
    """About the median of the first image, from every so many pixels."""
    dimension = images.shape[1]
    counts = np.zeros(256, np.int64)
    n = 0
    for j in range(0, dimension, max(1, dimension // _SAMPLE)):
        counts[images[0, j]] += 1
        n += 1
    level, above = 255, 0
    while above + counts[level] < n // 2:
        above += counts[level]
        level -= 1
    return np.uint8(level)


@_compile("void(uint8[:, ::1], int64[:, ::1], boolean[::1])")
def _encode(images, words, constant):
    """:func:`encode_uint8` in one thread.

    Frames of a session have nearly the same median, so the level of the last frame is tried first
    and those near it next; each trial is one pass over the frame.
    """
    if len(images) == 0:
        return
    dimension = images.shape[1]
    ones = dimension // 2
    level = int(_sampled_level(images))
    for i in range(len(images)):
        low, high, step = 0, 255, 1
        while True:
            n_greater, n_equal = _threshold(images, i, np.uint8(level), words)
            if n_greater > ones:
                low = level + 1
                level = min(level + step, (low + high) // 2)
            elif n_greater + n_equal < ones:
                high = level - 1
                level = max(level - step, (low + high + 1) // 2)
            else:
                break
            step *= 2
        _add_ties(images, i, np.uint8(level), words, ones - n_greater)
        constant[i] = n_equal == dimension


@_compile("void(int64[:, :, ::1], int64[:, ::1], int64[::1], int64[::1], int64, int64)")
def _count(counts, words, order, ends, start, stop):
    """:func:`count_into` for words start to stop, in one thread."""
    n_planes = counts.shape[1]
    stop = min(stop, words.shape[1])
    for left in range(start, stop, _BLOCK):
        right = min(left + _BLOCK, stop)
        whole = left + (right - left) // _LANES * _LANES
        first = 0
        for c in range(len(ends)):
            end = ends[c]
            while first < end:
                if first + _ROWS <= end:
                    for place in range(left, whole, _LANES):
                        _add_some_rows(counts, c, words, order, first, place)
                    n = _ROWS
                else:
                    for place in range(left, whole, _LANES):
                        _add_one_row(counts, c, words, order, first, place)
                    n = 1
                for place in range(whole, right):  # what fills no vector
                    for k in range(first, first + n):
                        carry = words[order[k], place]
                        for p in range(n_planes):
                            old = counts[c, p, place]
                            counts[c, p, place] = old ^ carry
                            carry &= old
                first += n
