"""8-bit frames to hypervectors, at multiples of their deviation (:mod:`hdc.encoders.deviation`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from hdc.compiled.encode import histogram, put
from hdc.compiled.operations import WORD, compile_kernel, exceeds, share

_LEAST = -(2**31)  # of int32; less than any difference and any level
_MOST = 2**31 - 1


def histograms(images: np.ndarray) -> np.ndarray:
    """How many pixels of images [N, D] have each grey value: int64 [N, 256]."""
    images = np.ascontiguousarray(images)
    counts = np.empty((len(images), 256), np.int64)

    def work(start: int, stop: int) -> None:
        _histograms(images, counts, start, stop)

    share(work, len(images), images.nbytes)
    return counts


def encode_deviation(
    images: np.ndarray,
    tables: np.ndarray,
    reference: np.ndarray,
    thresholds: Sequence[Fraction],
    words: np.ndarray,
) -> np.ndarray:
    """Fill words [N, ⌈T·D/64⌉] with the hypervectors of images [N, D].

    Args:
        images: grey values.
        tables: what each value stands for in each image, int32 [N, 256].
        reference: what is subtracted, int32 [D].
        thresholds: T of them, in units of the deviation of the differences.
        words: to be filled.

    Returns:
        The deviations int64 [N], rounded down.
    """
    images = np.ascontiguousarray(images)
    numerators = np.array([t.numerator for t in thresholds], np.int64)
    denominators = np.array([t.denominator for t in thresholds], np.int64)
    deviations = np.empty(len(images), np.int64)

    def work(start: int, stop: int) -> None:
        rows = slice(start, stop)
        _encode(
            images[rows],
            tables[rows],
            reference,
            numerators,
            denominators,
            words[rows],
            deviations[rows],
        )

    share(work, len(images), images.nbytes * len(thresholds))
    return deviations


@compile_kernel("void(uint8[:, ::1], int64[:, ::1], intp, intp)")
def _histograms(images, counts, start, stop):
    """:func:`histograms` of images start to stop, in one thread."""
    for i in range(start, stop):
        histogram(images, i, counts[i])


@compile_kernel("int64(uint8[:, ::1], intp, int32[:, ::1], int32[::1], int32[:, ::1])")
def _differences(images, i, tables, reference, differences):
    """Fill differences [1, ≥ D] of image i; their deviation, rounded down."""
    n = images.shape[1]
    total = square = np.int64(0)
    for j in range(n):
        difference = np.int64(tables[i, images[i, j]]) - reference[j]
        differences[0, j] = difference
        total += difference
        square += difference * difference
    variance = (square - (total * total + n - 1) // n) // n
    return np.int64(math.sqrt(variance))  # exact below 2⁵²


@compile_kernel(
    "void(uint8[:, ::1], int32[:, ::1], int32[::1], int64[::1], int64[::1],"
    " int64[:, ::1], int64[::1])"
)
def _encode(images, tables, reference, numerators, denominators, words, deviations):
    """:func:`encode_deviation` in one thread."""
    n_pixels = images.shape[1]
    width = (n_pixels + WORD - 1) // WORD
    differences = np.full((1, width * WORD), _LEAST, np.int32)
    row = np.empty(width, np.int64)
    for i in range(len(images)):
        sigma = _differences(images, i, tables, reference, differences)
        deviations[i] = sigma
        words[i] = 0
        for t in range(len(numerators)):
            level = numerators[t] * sigma // denominators[t]
            level = min(max(level, _LEAST + 1), _MOST)
            for w in range(width):
                row[w] = np.int64(exceeds(differences, 0, w * WORD, np.int32(level)))
            put(row, words[i], t * n_pixels)
