"""Weighted sums of hypervectors, for the weights of linear read-outs."""

from __future__ import annotations

import numpy as np

from hdc.compiled.operations import AT_ONCE, WORD, compile_kernel, share, sum_where

_BLOCK = 8  # words of a row at a time: one cache line


def combine(words: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Σ_i a_ik·bit_ij of hypervectors int64 [N, W], a float32 [N, K]: float32 [K, 64·W].

    Added frame by frame in rising order; a matrix product may add, and so round, in another order.
    """
    words = np.ascontiguousarray(words)
    width = words.shape[1]
    n_sums = coefficients.shape[1]
    coefficients = np.ascontiguousarray(coefficients)
    padded = np.pad(coefficients, ((0, 0), (0, -n_sums % AT_ONCE)))
    sums = np.empty((n_sums, width * WORD), np.float32)

    def work(start: int, stop: int) -> None:
        end = min(width, stop * _BLOCK)
        _combine(words, padded, sums, start * _BLOCK, end)

    share(work, -(-width // _BLOCK), words.nbytes)
    return sums


@compile_kernel("void(int64[:, ::1], float32[:, ::1], float32[:, ::1], intp, intp)")
def _combine(words, coefficients, sums, start, stop):
    """:func:`combine` of words start to stop, in one thread."""
    columns = np.empty((_BLOCK, len(words)), np.int64)
    part = np.empty((AT_ONCE, WORD), np.float32)
    for left in range(start, stop, _BLOCK):
        right = min(left + _BLOCK, stop)
        for i in range(len(words)):
            for w in range(left, right):
                columns[w - left, i] = words[i, w]
        for first in range(0, len(sums), AT_ONCE):
            last = min(first + AT_ONCE, len(sums))
            for w in range(left, right):
                sum_where(columns, w - left, coefficients, first, part)
                for k in range(first, last):
                    sums[k, w * WORD : (w + 1) * WORD] = part[k - first]
