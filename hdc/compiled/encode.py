"""8-bit frames to hypervectors, thresholded at quantiles (:mod:`hdc.encoders.ranks`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdc.compiled.operations import (
    WORD,
    compile_kernel,
    equal,
    greater,
    of_pixels,
    ones,
    share,
)

RULES = ("spread", "raster", "below")
_SPREAD, _RASTER, _BELOW = range(3)
_TRIALS = 4  # of levels that a sample proposes


def encode_uint8(
    images: np.ndarray, words: np.ndarray, n_ones: Sequence[int], rule: str
) -> tuple[np.ndarray, np.ndarray]:
    """Fill words [N, ⌈T·D/64⌉] with the hypervectors of images [N, D ≥ 2] at T thresholds.

    Threshold t makes the n_ones[t] largest pixels ones, ties by a rule of :data:`RULES`. A single
    one reads a frame about once; several read it twice, once for its histogram.

    Returns:
        How many pixels equal each threshold, int64 [N, T], and whether only some of them are ones.
    """
    images = np.ascontiguousarray(images)
    wanted = np.array(n_ones, np.int64)
    ties = np.zeros((len(images), 2 * len(wanted)), np.int64)
    code = RULES.index(rule)

    def work(start: int, stop: int) -> None:
        rows = np.arange(start, stop)
        into = words[start:stop]
        if len(wanted) == 1:
            encode_rows(images, rows, into, ties, 127, n_ones[0], code)
        else:
            _encode_levels(images, rows, into, ties, wanted, code)

    share(work, len(images), images.nbytes)
    return counted(ties)


def counted(ties: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What :func:`encode_uint8` returns, of pixels at a threshold and ones of them, [N, 2·T]."""
    n_equal = ties[:, ::2]
    missing = ties[:, 1::2]
    return n_equal, (missing > 0) & (missing < n_equal)


# One threshold -----------------------------------------------------------------------------------


@compile_kernel("uint64[::1](int64)")
def rotations_of(width):
    """h(w) of :mod:`hdc.encoders.ties`, [W]."""
    rotations = np.empty(width, np.uint64)
    for w in range(width):
        rotations[w] = ((w * 0x9E37_79B1) & 0xFFFF_FFFF) >> 26
    return rotations


@compile_kernel("uint64(uint64, uint64)")
def _rotated_left(word, by):
    return (word << by) | (word >> ((np.uint64(64) - by) & np.uint64(63)))


@compile_kernel("uint64(uint64, uint64)")
def _rotated_right(word, by):
    return (word >> by) | (word << ((np.uint64(64) - by) & np.uint64(63)))


@compile_kernel("int64(uint64[::1], int64)")
def _count_rounds(rotated, n):
    """Ties in the first n ≤ 63 rounds."""
    low = (np.uint64(1) << np.uint64(n)) - np.uint64(1)
    total = np.int64(0)
    for w in range(len(rotated)):
        total += ones(rotated[w] & low)
    return total


@compile_kernel("void(uint64[::1], int64[::1], uint64[::1], int64, int64)")
def _add_spread(equals, words, rotations, missing, n_equal):
    """Add the first `missing` of n_equal ties to words [W], by the order of ``spread``.

    How many rounds of one bit a word fit whole is guessed from the share that is missing, which is
    about right, since the order is even.
    """
    width = len(equals)
    for w in range(width):
        equals[w] = _rotated_left(equals[w], rotations[w])
    low, n_low, high, n_high = np.int64(0), np.int64(0), np.int64(64), n_equal
    while high - low > 1:
        guess = low + (missing - n_low) * (high - low) // max(
            np.int64(1), n_high - n_low
        )
        guess = min(max(guess, low + 1), high - 1)
        count = _count_rounds(equals, guess)
        if count <= missing:
            low, n_low = guess, count
        else:
            high, n_high = guess, count
    place = np.uint64(low)
    whole_rounds = (np.uint64(1) << place) - np.uint64(1)
    for w in range(width):
        words[w] |= np.int64(_rotated_right(equals[w] & whole_rounds, rotations[w]))
    rest = missing - n_low
    for w in range(width):
        if rest == 0:
            return
        bit = (equals[w] >> place) & np.uint64(1)
        words[w] |= np.int64(_rotated_right(bit << place, rotations[w]))
        rest -= np.int64(bit)


@compile_kernel("void(uint64[::1], int64[::1], int64)")
def _add_first(equals, words, missing):
    """Add the first `missing` ties to words [W], in raster order."""
    for w in range(len(equals)):
        if missing <= 0:
            return
        ties = equals[w]
        n = ones(ties)
        if n > missing:  # leave the lowest ones alone
            rest = ties
            for _ in range(missing):
                rest &= rest - np.uint64(1)
            ties ^= rest
        words[w] |= np.int64(ties)
        missing -= n


@compile_kernel("void(uint64[::1], int64[::1], uint64[::1], int64, int64, int64)")
def add_ties(equals, words, rotations, missing, n_equal, rule):
    """Add ties to words [W] until `missing` are added, by a rule of :data:`RULES`."""
    if missing == n_equal:
        for w in range(len(equals)):
            words[w] |= np.int64(equals[w])
    elif rule == _SPREAD:
        _add_spread(equals, words, rotations, missing, n_equal)
    elif rule == _RASTER:
        _add_first(equals, words, missing)


@compile_kernel("UniTuple(uint64, 2)(uint8[:, ::1], intp, uint8)")
def _last_word(images, i, level):
    """Pixels above a level and at it, of the word that is not full."""
    whole, rest = divmod(images.shape[1], WORD)
    above = at = np.uint64(0)
    for j in range(rest):
        pixel = images[i, whole * WORD + j]
        above |= np.uint64(pixel > level) << np.uint64(j)
        at |= np.uint64(pixel == level) << np.uint64(j)
    return above, at


@compile_kernel(
    "UniTuple(int64, 2)(uint8[:, ::1], intp, uint8, int64[::1], uint64[::1],"
    " int64[::1], boolean)"
)
def _threshold(images, i, level, words, equals, sample, sampled):
    """Fill words [W] with the pixels above a level and `equals` with those at it; count both.

    Where it is to be `sampled`, one pixel of each word is counted in sample [256].
    """
    whole, rest = divmod(images.shape[1], WORD)
    n_greater = n_equal = 0
    for w in range(whole):
        above = greater(images, i, w * WORD, level)
        at = equal(images, i, w * WORD, level)
        words[w] = np.int64(above)
        equals[w] = at
        n_greater += ones(above)
        n_equal += ones(at)
        if sampled:  # at a place that differs, lest the sample follow a pattern
            place = (w * 0x9E37_79B1 >> 8) % WORD
            sample[images[i, w * WORD + place]] += 1
    if rest:
        above, at = _last_word(images, i, level)
        words[whole] = np.int64(above)
        equals[whole] = at
        n_greater += ones(above)
        n_equal += ones(at)
    return n_greater, n_equal


@compile_kernel(
    "uint8(uint8[:, ::1], int64[::1], int64[:, ::1], int64[:, ::1], uint8, int64, int64)"
)
def encode_rows(images, rows, words, ties, level, n_ones, rule):
    """:func:`encode_uint8` of some rows of images at one threshold, in one thread.

    The level of the frame before is tried first, in one pass over the frame. Then the counts of all
    pixels say how many are too many or too few above it, and a sample which level has as many. What
    neither finds in some trials is found by halving. The level of the last frame is returned.
    """
    level = np.int64(level)
    sample = np.zeros(256, np.int64)
    equals = np.empty((images.shape[1] + WORD - 1) // WORD, np.uint64)
    rotations = rotations_of(len(equals))
    for k in range(len(rows)):
        i = rows[k]
        sample[:] = 0
        low, high, trials = 0, 255, 0
        while True:
            n_greater, n_equal = _threshold(
                images, i, np.uint8(level), words[k], equals, sample, trials == 0
            )
            trials += 1
            if n_greater > n_ones:
                low = level + 1
                surplus = n_greater - n_ones - sample[low] * WORD
                level = low
                while surplus > 0 and level < high:
                    level += 1
                    surplus -= sample[level] * WORD
            elif n_greater + n_equal < n_ones:
                high = level - 1
                missing = n_ones - n_greater - n_equal - sample[high] * WORD
                level = high
                while missing > 0 and level > low:
                    level -= 1
                    missing -= sample[level] * WORD
            else:
                break
            if trials > _TRIALS:
                level = (low + high) // 2
        missing = n_ones - n_greater
        add_ties(equals, words[k], rotations, missing, n_equal, rule)
        ties[i, 0] = n_equal
        ties[i, 1] = missing
    return np.uint8(level)


# Several thresholds ------------------------------------------------------------------------------


@compile_kernel(*of_pixels("void(uint8[:, ::1], intp, int64[::1])"))
def histogram(images, i, counts):
    """Count the pixels of an image by level, in counts [G].

    In four tables, lest one count wait for the last.
    """
    a = np.zeros(len(counts), np.int64)
    b = np.zeros(len(counts), np.int64)
    c = np.zeros(len(counts), np.int64)
    counts[:] = 0
    n = images.shape[1]
    whole = n - n % 4
    for j in range(0, whole, 4):
        counts[images[i, j]] += 1
        a[images[i, j + 1]] += 1
        b[images[i, j + 2]] += 1
        c[images[i, j + 3]] += 1
    for j in range(whole, n):
        counts[images[i, j]] += 1
    counts += a + b + c


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
    "void(uint8[:, ::1], int64[::1], int64[:, ::1], int64[:, ::1], int64[::1], int64)"
)
def _encode_levels(images, rows, words, ties, wanted, rule):
    """:func:`encode_uint8` of some rows of images at T thresholds, in one thread."""
    n_pixels, n_levels = images.shape[1], len(wanted)
    width = (n_pixels + WORD - 1) // WORD
    whole = n_pixels // WORD
    counts = np.empty(256, np.int64)
    levels = np.empty(n_levels, np.int64)
    missing = np.empty(n_levels, np.int64)
    above = np.empty((n_levels, width), np.int64)
    equals = np.empty((n_levels, width), np.uint64)
    rotations = rotations_of(width)
    for k in range(len(rows)):
        i = rows[k]
        histogram(images, i, counts)
        for t in range(n_levels):
            level, n_greater = np.int64(255), np.int64(0)
            while level > 0 and n_greater + counts[level] < wanted[t]:
                n_greater += counts[level]
                level -= 1
            levels[t] = level
            missing[t] = wanted[t] - n_greater
        for w in range(whole):
            for t in range(n_levels):
                above[t, w] = np.int64(
                    greater(images, i, w * WORD, np.uint8(levels[t]))
                )
                equals[t, w] = equal(images, i, w * WORD, np.uint8(levels[t]))
        words[k] = 0
        for t in range(n_levels):
            if whole < width:
                last, at = _last_word(images, i, np.uint8(levels[t]))
                above[t, whole] = np.int64(last)
                equals[t, whole] = at
            n_equal = counts[levels[t]]
            add_ties(equals[t], above[t], rotations, missing[t], n_equal, rule)
            put(above[t], words[k], t * n_pixels)
            ties[i, 2 * t] = n_equal
            ties[i, 2 * t + 1] = missing[t]
