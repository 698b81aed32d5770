"""Weighted sums of hypervectors, which weights of linear read-outs are."""

from __future__ import annotations

import numpy as np

from hdc.compiled.operations import WORD, add_where, compile_kernel, share

_BLOCK = 8  # words of a row at a time: a line of the cache


def combine(words: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Σ_i a_ik·bit_ij of hypervectors int64 [N, W], a float32 [N, K]: float32 [K, 64·W]."""
    words = np.ascontiguousarray(words)
    coefficients = np.ascontiguousarray(coefficients)
    width = words.shape[1]
    n_sums = coefficients.shape[1]
    sums = np.empty((n_sums, width * WORD), np.float32)

    def work(start: int, stop: int) -> None:
        end = min(width, stop * _BLOCK)
        _combine(words, coefficients, sums, start * _BLOCK, end)

    share(work, -(-width // _BLOCK), words.nbytes)
    return sums


@compile_kernel("void(int64[:, ::1], float32[:, ::1], float32[:, ::1], intp, intp)")
def _combine(words, coefficients, sums, start, stop):
    """:func:`combine` of words start to stop, in one thread."""
    n_sums = coefficients.shape[1]
    sums[:, start * WORD : stop * WORD] = 0
    for left in range(start, stop, _BLOCK):
        right = min(left + _BLOCK, stop)
        for i in range(len(words)):
            for w in range(left, right):
                word = np.uint64(words[i, w])
                for k in range(n_sums):
                    add_where(sums, k, w * WORD, coefficients[i, k], word)
