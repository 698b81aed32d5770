"""Parts of the kernels: threads, operations spelled out for LLVM, and compiling.

Two operations are spelled out for LLVM, which does not find them by itself. One adds a number to
each of 64 sums whose bit in a word is one, and keeps the sums in registers. The other compares 64
numbers and returns one word of mask. It takes 6 µs for a frame of 500 × 500, where a plain loop
over pixels takes 44 µs, and a loop over words of eight pixels 23 µs (one core of an AMD EPYC,
Zen 4).

Work is shared among `torch.get_num_threads()` threads of Python: numba releases the interpreter
meanwhile, and no second pool of native threads competes with torch's.
"""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import torch
from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

if config.DISABLE_JIT:  # type: ignore[attr-defined]  # set as it is imported
    raise ImportError("numba compiles nothing, by NUMBA_DISABLE_JIT")

WORD = 64
PIXELS = ("uint8", "uint16", "int32")
"""Types of pixels that the kernels take: from cameras, and of frames minus a reference."""
AT_ONCE = 4  # weighted sums made at once
_SHARE_BYTES = 2**17  # of input for which another thread pays


def share(work: Callable[[int, int], object], n: int, n_bytes: int) -> None:
    """Call work(start, stop) on consecutive pieces of range(n), one per thread."""
    worth = n_bytes // _SHARE_BYTES
    n_threads = min(torch.get_num_threads(), n, worth)
    if n_threads < 2:
        work(0, n)
        return
    cuts = [n * i // n_threads for i in range(n_threads + 1)]
    pool = _pool(os.getpid())
    pieces = itertools.pairwise(cuts[1:])
    others = [pool.submit(work, *piece) for piece in pieces]
    work(0, cuts[1])
    for other in others:
        other.result()


def share_rows(
    kernel: Callable[..., object],
    n_bytes: int,
    arrays: Sequence[np.ndarray],
    *others: object,
) -> None:
    """Call a kernel on consecutive rows of some arrays, a piece per thread, and on the others."""

    def work(start: int, stop: int) -> None:
        kernel(*(array[start:stop] for array in arrays), *others)

    share(work, len(arrays[0]), n_bytes)


@functools.cache
def _pool(process: int) -> ThreadPoolExecutor:
    """Threads of this process; a forked process inherits the pool but not its threads."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="compiled")


def compile_kernel(*signatures):
    """numba's njit, which caches the machine code if its folder is writable."""

    def compiled(function):
        kinds = list(signatures)
        try:
            return njit(kinds, nogil=True, cache=True)(function)
        except (RuntimeError, OSError):
            return njit(kinds, nogil=True)(function)

    return compiled


def of_pixels(signature: str) -> list[str]:
    """The signatures of a kernel for every type of pixel, in place of the word "pixel"."""
    return [signature.replace("pixel", kind) for kind in PIXELS]


# Typed, so that mypy keeps the arguments of the decorated functions.
_operation: Any = intrinsic


def _pointer(context, builder, kind, array, place):
    """Pointer to an element of an array, without a check of bounds."""
    view = context.make_array(kind)(context, builder, array)
    return cgutils.get_item_pointer(context, builder, kind, view, place)


def _everywhere(builder, vector, value):
    """A vector with a value in all of its 64 places."""
    i32 = ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, i32(0))
    first_place = ir.Constant(ir.VectorType(i32, WORD), None)
    return builder.shuffle_vector(one, one, first_place)


def _compare(relation: str):
    """An intrinsic (pixels, row, start, level) → the mask of 64 pixels, the first one lowest."""

    @_operation
    def compare(typing_context, pixels, row, start, level):
        number = pixels.dtype

        def code(context, builder, signature, arguments):
            pixels, row, start, level = arguments
            place = _pointer(context, builder, signature.args[0], pixels, (row, start))
            vector = ir.VectorType(ir.IntType(number.bitwidth), WORD)
            block = builder.load(builder.bitcast(place, vector.as_pointer()), align=1)
            levels = _everywhere(builder, vector, level)
            to_mask = builder.icmp_signed if number.signed else builder.icmp_unsigned
            mask = to_mask(relation, block, levels)
            return builder.bitcast(mask, ir.IntType(WORD))

        return types.uint64(pixels, types.intp, types.intp, number), code

    return compare


greater = _compare(">")
at_least = _compare(">=")


@_operation
def ones(typing_context, word):
    """The number of ones of a word."""

    def code(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return types.int64(types.uint64), code


@_operation
def sum_where(typing_context, masks, w, numbers, k, sums):
    """Set sums[t, j] to Σ_i numbers[i, k + t] over all i where bit j of masks[w, i] is one.

    In float32, for four t at once, whose 4 × 64 sums fill half of the registers of AVX-512. The sum
    runs over rising i, so it is rounded as by a plain loop.
    """

    def code(context, builder, signature, arguments):
        masks, w, numbers, k, sums = arguments
        vector = ir.VectorType(ir.FloatType(), WORD)
        flags = ir.VectorType(ir.IntType(1), WORD)
        totals = [cgutils.alloca_once(builder, vector) for _ in range(AT_ONCE)]
        for total in totals:
            builder.store(ir.Constant(vector, None), total)
        view = context.make_array(signature.args[0])(context, builder, masks)
        n = cgutils.unpack_tuple(builder, view.shape)[1]
        with cgutils.for_range(builder, n) as loop:
            place = w, loop.index
            pointer = _pointer(context, builder, signature.args[0], masks, place)
            is_one = builder.bitcast(builder.load(pointer), flags)
            for t, total in enumerate(totals):
                place = loop.index, builder.add(k, ir.Constant(k.type, t))
                pointer = _pointer(context, builder, signature.args[2], numbers, place)
                number = _everywhere(builder, vector, builder.load(pointer))
                before = builder.load(total)
                after = builder.fadd(before, number)
                builder.store(builder.select(is_one, after, before), total)
        for t, total in enumerate(totals):
            place = ir.Constant(k.type, t), ir.Constant(k.type, 0)
            pointer = _pointer(context, builder, signature.args[4], sums, place)
            pointer = builder.bitcast(pointer, vector.as_pointer())
            builder.store(builder.load(total), pointer, align=4)
        return context.get_dummy_value()

    return types.void(masks, types.intp, numbers, types.intp, sums), code
