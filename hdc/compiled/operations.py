"""What the kernels are made of: threads, operations spelled out for LLVM, and compiling.

Two operations are spelled out for LLVM, which does not find them by itself. One adds a number to
those of 64 whose bit in a word is one, in an eighth of the time of a loop over bits. The other
compares 64 bytes, and its outcome is one word of mask. It passes a frame of 500 × 500 in 6 µs; a
plain loop over pixels takes 44 µs, and one over words of eight pixels 23 µs (one core of an AMD
EPYC, Zen 4).

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

import torch
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

WORD = 64
_SHARE_BYTES = 2**17  # of input that are worth another thread


def share(work: Callable[[int, int], object], n: int, n_bytes: int) -> None:
    """work(start, stop) on consecutive pieces of range(n), one a thread."""
    worth = n_bytes // _SHARE_BYTES
    n_threads = max(1, min(torch.get_num_threads(), n, worth))
    cuts = [n * i // n_threads for i in range(n_threads + 1)]
    pool = _pool(os.getpid())
    pieces = itertools.pairwise(cuts[1:])
    others = [pool.submit(work, *piece) for piece in pieces]
    work(0, cuts[1])
    for other in others:
        other.result()


@functools.cache
def _pool(process: int) -> ThreadPoolExecutor:
    """Threads of this process; a forked one has the pool of its parent but not its threads."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="compiled")


def compile_kernel(signature):
    """numba's njit, which keeps the machine code where a folder can be written."""

    def compiled(function):
        try:
            return njit(signature, nogil=True, cache=True)(function)
        except (RuntimeError, OSError):
            return njit(signature, nogil=True)(function)

    return compiled


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
            # Without a check of bounds.
            place = cgutils.get_item_pointer(
                context, builder, signature.args[0], view, (row, start)
            )
            vector = ir.VectorType(ir.IntType(8), WORD)
            block = builder.load(builder.bitcast(place, vector.as_pointer()), align=1)
            i32 = ir.IntType(32)
            one = builder.insert_element(
                ir.Constant(vector, ir.Undefined), level, i32(0)
            )
            zeros = ir.Constant(ir.VectorType(i32, WORD), None)
            levels = builder.shuffle_vector(one, one, zeros)
            mask = builder.icmp_unsigned(relation, block, levels)
            return builder.bitcast(mask, ir.IntType(WORD))

        return types.uint64(pixels, types.intp, types.intp, types.uint8), code

    return compare


greater = _compare(">")
equal = _compare("==")


@_operation
def ones(typing_context, word):
    """The number of ones of a word."""

    def code(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return types.int64(types.uint64), code


@_operation
def add_where(typing_context, sums, row, start, number, word):
    """Add a float32 to those of sums[row, start : start + 64] whose bit of the word is one."""

    def code(context, builder, signature, arguments):
        sums, row, start, number, word = arguments
        view = context.make_array(signature.args[0])(context, builder, sums)
        # Without a check of bounds.
        place = cgutils.get_item_pointer(
            context, builder, signature.args[0], view, (row, start)
        )
        vector = ir.VectorType(ir.FloatType(), WORD)
        pointer = builder.bitcast(place, vector.as_pointer())
        i32 = ir.IntType(32)
        first = builder.insert_element(
            ir.Constant(vector, ir.Undefined), number, i32(0)
        )
        places = ir.Constant(ir.VectorType(i32, WORD), None)
        everywhere = builder.shuffle_vector(first, first, places)
        mask = builder.bitcast(word, ir.VectorType(ir.IntType(1), WORD))
        added = builder.select(mask, everywhere, ir.Constant(vector, None))
        total = builder.fadd(builder.load(pointer, align=4), added)
        builder.store(total, pointer, align=4)
        return context.get_dummy_value()

    parts = types.intp, types.intp, types.float32, types.uint64
    return types.void(sums, *parts), code
