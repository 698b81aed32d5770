"""Standardised frames (:mod:`hdc.encoders.relative`), and their bits by thresholds
(:mod:`hdc.encoders.deviation`)."""

from __future__ import annotations

import numpy as np

from hdc.compiled.encode import put, rest_of
from hdc.compiled.operations import WORD, compile_kernel, greater, of_pixels, share_rows


def sums(images: np.ndarray) -> np.ndarray:
    """Sums of the pixels of images [N, D], and of their squares: int64 [N, 2]."""
    images = np.ascontiguousarray(images)
    found = np.empty((len(images), 2), np.int64)
    share_rows(_sums, images.nbytes, (images, found))
    return found


def in_steps(
    images: np.ndarray, totals: np.ndarray, deviations: np.ndarray, step: float
) -> np.ndarray:
    """(D·x − Σx)·step/deviation, rounded down, of images [N, D]: int32 [N, D].

    Args:
        images: grey values.
        totals: their sums, float64 [N].
        deviations: what to divide by, float64 [N].
        step: a power of two.
    """
    images = np.ascontiguousarray(images)
    values = np.empty(images.shape, np.int32)
    arrays = images, totals, deviations, values
    share_rows(_in_steps, values.nbytes, arrays, step)
    return values


def exceed(values: np.ndarray, levels: np.ndarray, words: np.ndarray) -> None:
    """Fill words [N, ⌈T·D/64⌉] with values int32 [N, D] > levels int32 [N, T]."""
    values = np.ascontiguousarray(values)
    n_bytes = values.nbytes * levels.shape[1]
    share_rows(_exceed, n_bytes, (values, levels, words))


# Kernels -----------------------------------------------------------------------------------------


@compile_kernel(*of_pixels("void(pixel[:, ::1], int64[:, ::1])"))
def _sums(images, found):
    for i in range(len(images)):
        total = square = np.int64(0)
        for j in range(images.shape[1]):
            pixel = np.int64(images[i, j])
            total += pixel
            square += pixel * pixel
        found[i, 0], found[i, 1] = total, square


@compile_kernel(
    *of_pixels(
        "void(pixel[:, ::1], float64[::1], float64[::1], int32[:, ::1], float64)"
    )
)
def _in_steps(images, totals, deviations, values, step):
    n_pixels = np.float64(images.shape[1])
    for i in range(len(images)):
        total, deviation = totals[i], deviations[i]
        for j in range(images.shape[1]):
            centred = n_pixels * images[i, j] - total
            values[i, j] = np.int32(np.floor(centred * step / deviation))


@compile_kernel("void(int32[:, ::1], int32[:, ::1], int64[:, ::1])")
def _exceed(values, levels, words):
    n_pixels = values.shape[1]
    whole, rest = divmod(n_pixels, WORD)
    row = np.zeros(whole + (rest > 0), np.int64)
    for i in range(len(values)):
        words[i] = 0
        for t in range(levels.shape[1]):
            for w in range(whole):
                row[w] = np.int64(greater(values, i, w * WORD, levels[i, t]))
            if rest:
                above, _ = rest_of(values, i, whole * WORD, levels[i, t], levels[i, t])
                row[whole] = np.int64(above)
            put(row, words[i], t * n_pixels)
