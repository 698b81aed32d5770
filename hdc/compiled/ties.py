"""The first of equal pixels, by the order of :mod:`hdc.encoders.ties`."""

from __future__ import annotations

import numpy as np

from hdc.compiled.operations import compile_kernel, ones
from hdc.encoders.ties import MULTIPLIER


@compile_kernel("uint64[::1](int64)")
def rotations_of(width):
    """h(w) of :mod:`hdc.encoders.ties`, [W]."""
    rotations = np.empty(width, np.uint64)
    for w in range(width):
        rotations[w] = ((w * MULTIPLIER) & 0xFFFF_FFFF) >> 26
    return rotations


@compile_kernel("uint64(uint64, uint64)")
def _rotated(word, by):
    """A word rotated to the left by 0 to 64 bits."""
    most = np.uint64(63)
    return (word << (by & most)) | (word >> ((np.uint64(64) - by) & most))


@compile_kernel("int64(uint64[::1], int64)")
def _count_rounds(rotated, n):
    """Ties in the first n ≤ 63 rounds."""
    low = (np.uint64(1) << np.uint64(n)) - np.uint64(1)
    total = np.int64(0)
    for w in range(len(rotated)):
        total += ones(rotated[w] & low)
    return total


@compile_kernel("void(uint64[::1], int64[::1], uint64[::1], int64, int64)")
def add_ties(equals, words, rotations, missing, n_equal):
    """Add the first `missing` of n_equal ties to words [W], by the order of ``spread``.

    How many whole rounds of one bit per word fit is guessed from the share that is missing. Since
    the order is even, the guess is nearly right.
    """
    width = len(equals)
    if missing == n_equal:
        for w in range(width):
            words[w] |= np.int64(equals[w])
        return
    for w in range(width):
        equals[w] = _rotated(equals[w], rotations[w])
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
        back = np.uint64(64) - rotations[w]
        words[w] |= np.int64(_rotated(equals[w] & whole_rounds, back))
    rest = missing - n_low
    for w in range(width):
        if rest == 0:
            return
        bit = (equals[w] >> place) & np.uint64(1)
        back = np.uint64(64) - rotations[w]
        words[w] |= np.int64(_rotated(bit << place, back))
        rest -= np.int64(bit)
