"""Frames of 8 or 16 bits less a reference to hypervectors (:mod:`hdc.encoders.relative`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from hdc.compiled.encode import RULES, add_ties, counted, histogram, put, rotations_of
from hdc.compiled.operations import (
    WORD,
    compile_kernel,
    exceeds,
    of_pixels,
    ones,
    share,
)

_LEAST = -(2**31)  # of int32; less than any difference and any level
_MOST = 2**31 - 1
_BINS = (
    2**12
)  # of the differences of a frame, which are counted before some are ordered


def histograms(images: np.ndarray) -> np.ndarray:
    """How many pixels of images [N, D] have each grey value: int64 [N, G].

    G is 256 of 8 bits, or the largest value of 16 bits and one.
    """
    images = np.ascontiguousarray(images)
    n_greys = 256 if images.dtype == np.uint8 else int(images.max()) + 1
    counts = np.empty((len(images), n_greys), np.int64)

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
        tables: what each value stands for in each image, int32 [N, G].
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


def encode_differences(
    images: np.ndarray,
    tables: np.ndarray,
    reference: np.ndarray,
    n_ones: Sequence[int],
    rule: str,
    words: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """:func:`hdc.compiled.encode.encode_uint8` of differences instead of grey values.

    Images, tables and reference are those of :func:`encode_deviation`.
    """
    images = np.ascontiguousarray(images)
    wanted = np.array(n_ones, np.int64)
    ties = np.empty((len(images), 2 * len(wanted)), np.int64)
    code = RULES.index(rule)

    def work(start: int, stop: int) -> None:
        rows = slice(start, stop)
        _encode_ranks(
            images[rows], tables[rows], reference, wanted, words[rows], ties[rows], code
        )

    share(work, len(images), images.nbytes * len(wanted))
    return counted(ties)


@compile_kernel(*of_pixels("void(uint8[:, ::1], int64[:, ::1], intp, intp)"))
def _histograms(images, counts, start, stop):
    """:func:`histograms` of images start to stop, in one thread."""
    for i in range(start, stop):
        histogram(images, i, counts[i])


@compile_kernel(
    *of_pixels("int64(uint8[:, ::1], intp, int32[:, ::1], int32[::1], int32[:, ::1])")
)
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
    return np.int64(math.sqrt(max(variance, np.int64(0))))  # exact below 2⁵²


@compile_kernel(
    *of_pixels(
        "void(uint8[:, ::1], int32[:, ::1], int32[::1], int64[::1], int64[::1],"
        " int64[:, ::1], int64[::1])"
    )
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


@compile_kernel("int64(int32[::1], int64[::1], int64[::1], int64[::1], int32[::1])")
def _thresholds(values, wanted, levels, missing, places):
    """Find the wanted[t]-th largest of the values, and how many are missing above it, for each t.

    Values are counted in bins; those of the bins in which a level lies are ordered. Returns how
    many these are, with the first of `places` [D] filled with where they are.
    """
    least = most = values[0]
    for j in range(len(values)):
        least, most = min(least, values[j]), max(most, values[j])
    low, high = np.int64(least), np.int64(most)
    shift = np.int64(0)
    while (high - low) >> shift >= _BINS:
        shift += 1
    counts = np.zeros(_BINS, np.int64)
    for j in range(len(values)):
        counts[(values[j] - low) >> shift] += 1
    behind = np.zeros(_BINS, np.int64)  # of the bins that are searched, up to each
    for t in range(len(wanted)):
        place, above = (high - low) >> shift, np.int64(0)
        while place > 0 and above + counts[place] < wanted[t]:
            above += counts[place]
            place -= 1
        levels[t], missing[t] = place, wanted[t] - above
        behind[place] = counts[place]
    n = np.int64(0)
    for j in range(len(values)):
        if behind[(values[j] - low) >> shift]:
            places[n] = j
            n += 1
    found = np.empty(n, np.int32)
    for k in range(n):
        found[k] = values[places[k]]
    found.sort()
    behind = behind.cumsum()
    for t in range(len(wanted)):
        levels[t] = found[behind[levels[t]] - max(np.int64(1), missing[t])]
    return n


@compile_kernel(
    *of_pixels(
        "void(uint8[:, ::1], int32[:, ::1], int32[::1], int64[::1], int64[:, ::1],"
        " int64[:, ::1], int64)"
    )
)
def _encode_ranks(images, tables, reference, wanted, words, ties, rule):
    """:func:`encode_differences` in one thread."""
    n_pixels = images.shape[1]
    width = (n_pixels + WORD - 1) // WORD
    differences = np.full((1, width * WORD), _LEAST, np.int32)
    places = np.empty(n_pixels, np.int32)
    above, equals = np.empty(width, np.int64), np.empty(width, np.uint64)
    levels, missing = np.empty_like(wanted), np.empty_like(wanted)
    rotations = rotations_of(width)
    for i in range(len(images)):
        _differences(images, i, tables, reference, differences)
        values = differences[0, :n_pixels]
        n_found = _thresholds(values, wanted, levels, missing, places)
        words[i] = 0
        for t in range(len(wanted)):
            n_above = n_equal = np.int64(0)
            for w in range(width):
                mask = exceeds(differences, 0, w * WORD, np.int32(levels[t]))
                above[w], equals[w] = np.int64(mask), 0
                n_above += ones(mask)
            for j in places[:n_found]:
                is_equal = values[j] == levels[t]
                equals[j // WORD] |= np.uint64(is_equal) << np.uint64(j % WORD)
                n_equal += is_equal
            n_missing = wanted[t] - n_above
            add_ties(equals, above, rotations, n_missing, n_equal, rule)
            put(above, words[i], t * n_pixels)
            ties[i, 2 * t], ties[i, 2 * t + 1] = n_equal, n_missing
