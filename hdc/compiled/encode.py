"""Frames of 8, 16 or 32 bits to hypervectors, thresholded by rank (:mod:`hdc.encoders.ranks`).

One pass over a frame counts the pixels above and within a range of grey values. The first range
lies about the threshold of the previous frame. If the threshold lies elsewhere, a sample of one
pixel per word tells which of 256 bins to try. In frames of 8 bits a bin is one grey value. In
others about one per cent of the pixels are left, among which the threshold is found by eight bits
at a time. The counts of all pixels decide, so neither the sample nor the previous frame affects the
result.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdc.compiled.operations import (
    WORD,
    at_least,
    compile_kernel,
    greater,
    of_pixels,
    ones,
    share_rows,
)
from hdc.compiled.ties import add_ties, rotations_of
from hdc.encoders.ties import MULTIPLIER

_BINS = 256
_TRIALS = 4  # of bins that the sample proposes


def encode(
    images: np.ndarray, words: np.ndarray, n_ones: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Fill words [N, ⌈T·D/64⌉] with the hypervectors of images [N, D] at T thresholds.

    Threshold t makes the n_ones[t] largest pixels ones.

    Returns:
        How many pixels equal each threshold, int64 [N, T], and whether only some of them are ones.
    """
    images = np.ascontiguousarray(images)
    wanted = np.array(n_ones, np.int64)
    n_equal = np.empty((len(images), len(wanted)), np.int64)
    missing = np.empty_like(n_equal)
    n_bytes = images.nbytes * len(wanted)
    share_rows(_encode, n_bytes, (images, words, n_equal, missing), wanted)
    return n_equal, (missing > 0) & (missing < n_equal)


# Kernels -----------------------------------------------------------------------------------------


@compile_kernel(*of_pixels("void(pixel[:, ::1], intp, int64[::1], int64[::1])"))
def _draw(images, i, sample, bins):
    """Count a sample of image i in 256 bins; bin b begins at the grey value low + (b << shift).

    The first and the last bin also hold what lies beyond them. Fills `sample` [256] with the counts
    and `bins` with low, shift and i.
    """
    n_pixels = images.shape[1]
    values = np.empty((n_pixels + WORD - 1) // WORD, np.int64)
    low = high = np.int64(images[i, 0])
    for w in range(len(values)):
        # At varying places, so that the sample does not follow a pattern.
        j = w * WORD + (w * MULTIPLIER >> 8) % WORD
        value = np.int64(images[i, min(j, n_pixels - 1)])
        values[w] = value
        low, high = min(low, value), max(high, value)
    shift = np.int64(0)
    while (high - low) >> shift >= _BINS:
        shift += 1
    sample[:] = 0
    for value in values:
        sample[(value - low) >> shift] += 1
    bins[0], bins[1], bins[2] = low, shift, i


@compile_kernel("int64(int64[::1], int64, int64, int64)")
def _walk(sample, place, step, n):
    """The bin that holds the n-th pixel, by the sample, counted from the bin after a place."""
    last = _BINS - 1 if step > 0 else 0
    while n > 0 and place != last:
        place += step
        n -= sample[place] * WORD
    return place


@compile_kernel(
    *of_pixels("UniTuple(uint64, 2)(pixel[:, ::1], intp, intp, pixel, pixel)")
)
def rest_of(images, i, start, bottom, top):
    """The pixels above `top`, and from `bottom` to `top`, in a last word that is not full."""
    above = within = np.uint64(0)
    for j in range(start, images.shape[1]):
        pixel = images[i, j]
        above |= np.uint64(pixel > top) << np.uint64(j - start)
        within |= np.uint64(bottom <= pixel <= top) << np.uint64(j - start)
    return above, within


@compile_kernel(
    *of_pixels(
        "UniTuple(int64, 2)(pixel[:, ::1], intp, pixel, pixel, int64[::1], uint64[::1])"
    )
)
def _look(images, i, bottom, top, above, within):
    """Fill words [W] with the pixels above `top`, and from `bottom` to `top`; count both."""
    n_above = n_within = np.int64(0)
    whole, rest = divmod(images.shape[1], WORD)
    for w in range(whole):
        more = greater(images, i, w * WORD, top)
        these = at_least(images, i, w * WORD, bottom) & ~more
        above[w] = np.int64(more)
        within[w] = these
        n_above += ones(more)
        n_within += ones(these)
    if rest:
        more, these = rest_of(images, i, whole * WORD, bottom, top)
        above[whole] = np.int64(more)
        within[whole] = these
        n_above += ones(more)
        n_within += ones(these)
    return n_above, n_within


@compile_kernel("UniTuple(int64, 3)(int64[::1], int64, int64)")
def _select(values, most, rank):
    """The value of a rank among values from 0 to `most`, and how many are above and equal to it.

    A radix selection by eight bits at a time, which changes the values.
    """
    n, n_above, level = len(values), np.int64(0), np.int64(0)
    counts = np.empty(_BINS, np.int64)
    shift = np.int64(0)
    while most >> shift:
        shift += 8
    while shift > 0:
        shift -= 8
        counts[:] = 0
        for value in values[:n]:
            counts[value >> shift] += 1
        place = np.int64(_BINS - 1)
        while n_above + counts[place] < rank:
            n_above += counts[place]
            place -= 1
        level += place << shift
        kept = 0
        for value in values[:n]:  # the remaining bits of the values in this place
            rest = value - (place << shift)
            values[kept] = rest
            kept += rest >> shift == 0
        n = kept
    return level, n_above, n


@compile_kernel(
    *of_pixels(
        "UniTuple(int64, 3)(pixel[:, ::1], intp, int64, int64, int64, int64[::1],"
        " uint64[::1], int64, int64[::1], int64[::1])"
    )
)
def _narrow(images, i, bottom, top, rank, above, within, n_within, places, values):
    """Find the pixel of a rank among the n_within pixels `within` [W], from `bottom` to `top`.

    Pixels equal to it stay in `within`, and brighter ones move to `above`. Returns its grey value,
    and how many pixels moved and stayed. No branch depends on pixels, which a processor would
    mispredict.
    """
    filled = np.empty(len(within), np.int64)
    n_filled = n = 0
    for w in range(len(within)):
        filled[n_filled] = w
        n_filled += within[w] != 0
    while n_filled > 0:  # take the lowest one of each word that has one left
        kept = 0
        for w in filled[:n_filled]:
            word = within[w]
            j = w * WORD + ones(~word & (word - np.uint64(1)))
            places[n], values[n] = j, images[i, j] - bottom
            n += 1
            word &= word - np.uint64(1)
            within[w] = word
            filled[kept] = w
            kept += word != 0
        n_filled = kept
    level, n_above, n_equal = _select(values[:n_within], top - bottom, rank)
    level += bottom
    for j in places[:n_within]:
        bit = np.uint64(j % WORD)
        pixel = np.int64(images[i, j])
        above[j // WORD] |= np.int64(np.uint64(pixel > level) << bit)
        within[j // WORD] |= np.uint64(pixel == level) << bit
    return level, n_above, n_equal


@compile_kernel("int64(int64, int64[::1])")
def _bin_of(grey, bins):
    return min(max(np.int64(0), (grey - bins[0]) >> bins[1]), np.int64(_BINS - 1))


@compile_kernel(
    *of_pixels(
        "UniTuple(int64, 4)(pixel[:, ::1], intp, int64, int64, int64, int64[::1],"
        " int64[::1], int64[::1], uint64[::1])"
    )
)
def _search(images, i, rank, bottom, top, sample, bins, above, within):
    """Find a range of grey values that holds the pixel of a rank; rank 1 is the largest.

    The search begins with the range from `bottom` to `top`. Fills words [W] with the pixels above
    the range and within it. Returns the ends of the range, and the two counts.
    """
    limits = np.iinfo(images.dtype)
    least, most = np.int64(limits.min), np.int64(limits.max)
    trials = 0
    while True:
        bottom, top = max(bottom, least), min(top, most)
        n_above, n_within = _look(images, i, bottom, top, above, within)
        if n_above < rank <= n_above + n_within:
            return bottom, top, n_above, n_within
        if bins[2] != i:
            _draw(images, i, sample, bins)
        if n_above >= rank:
            least = top + 1
            place = _walk(sample, _bin_of(top, bins), 1, n_above - rank + 1)
        else:
            most = bottom - 1
            missing = rank - n_above - n_within
            place = _walk(sample, _bin_of(bottom, bins), -1, missing)
        first, last = _bin_of(least, bins), _bin_of(most, bins)
        place = min(max(place, first), last)
        trials += 1
        if trials > _TRIALS:
            place = (first + last) // 2
        bottom = bins[0] + (place << bins[1]) if place > 0 else least
        top = bins[0] + ((place + 1) << bins[1]) - 1 if place < _BINS - 1 else most


@compile_kernel("void(int64[::1], int64[::1], int64)")
def put(words, row, start):
    """Put words [W] into row [W′], which is zero there, from bit `start` on."""
    place, shift = start // WORD, np.uint64(start % WORD)
    rest = np.uint64(WORD) - shift
    for w in range(len(words)):
        word = np.uint64(words[w])
        row[place + w] |= np.int64(word << shift)
        if shift and place + w + 1 < len(row):
            row[place + w + 1] |= np.int64(word >> rest)


@compile_kernel(
    *of_pixels(
        "void(pixel[:, ::1], int64[:, ::1], int64[:, ::1], int64[:, ::1], int64[::1])"
    )
)
def _encode(images, words, n_equal, missing, wanted):
    """:func:`encode` in one thread."""
    n_pixels, n_levels = images.shape[1], len(wanted)
    width = (n_pixels + WORD - 1) // WORD
    above, equals = np.empty(width, np.int64), np.empty(width, np.uint64)
    places, values = np.empty(n_pixels, np.int64), np.empty(n_pixels, np.int64)
    sample, bins = np.empty(_BINS, np.int64), np.zeros(3, np.int64)
    rotations = rotations_of(width)
    levels = np.empty(n_levels, np.int64)
    ranks = np.maximum(wanted, 1)  # of the thresholds, each of which is a pixel
    for i in range(len(images)):
        words[i] = 0
        if i == 0:
            _draw(images, i, sample, bins)
        for t in range(n_levels):
            if bins[2] == i:  # the first frame, or unlike the one before
                place = _walk(sample, _BINS, -1, ranks[t])
                levels[t] = bins[0] + (place << bins[1])
                near = np.int64(1) << bins[1]
                bottom, top = levels[t], levels[t] + near - 1
            else:
                near = np.int64((1 << bins[1]) >> 2)
                bottom, top = levels[t] - near, levels[t] + near
            level, top, n_above, n_at = _search(
                images, i, ranks[t], bottom, top, sample, bins, above, equals
            )
            if level < top:
                level, n_more, n_at = _narrow(
                    images, i, level, top, ranks[t] - n_above, above, equals, n_at,
                    places, values,
                )  # fmt: skip
                n_above += n_more
            levels[t] = level
            n_equal[i, t] = n_at
            missing[i, t] = wanted[t] - n_above
            add_ties(equals, above, rotations, missing[i, t], n_at)
            put(above, words[i], t * n_pixels)
