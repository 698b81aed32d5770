"""Search for the thresholds of large frames of integers, one frame after another.

One pass over a frame counts the pixels above a value, which shows on which side of it the threshold
lies. The threshold of the previous frame is tried first; then a sample proposes values (Floyd and
Rivest, Commun. ACM 18, 165 (1975)). With 8 bits, two or three passes suffice. The counts of all
pixels decide, so neither the previous frame nor the sample affects the result.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from torch import Tensor

from hdc import bits
from hdc.encoders.ties import count_ones, first_ties

_SAMPLE = 4096  # pixels of a frame that are sorted, at most


class Above(NamedTuple):
    """The pixels of a frame above a value."""

    value: int
    words: np.ndarray  # int64 [W]
    n: int


def one_by_one(pixels: Tensor, ones: Sequence[int]) -> tuple[Any, Any, Any]:
    """:func:`hdc.encoders.ranks.at_once` for large frames on the CPU, one after another."""
    images = pixels.numpy()
    n, n_pixels = images.shape
    words = np.zeros((n, bits.words_for(len(ones) * n_pixels)), np.int64)
    n_equal = np.empty((n, len(ones)), np.int64)
    split = np.empty((n, len(ones)), np.bool_)
    room = np.zeros(bits.words_for(n_pixels) * bits.WORD, np.bool_)
    guesses: list[int | None] = [None] * len(ones)  # thresholds of the previous frame
    for i, image in enumerate(images):
        frame = _Frame(image, room)
        for t, wanted in enumerate(ones):
            low, high = _search(frame, wanted, guesses[t])
            guesses[t] = high.value
            tied = low.n - high.n
            missing = wanted - high.n
            first = first_ties(low.words ^ high.words, tied, missing)
            _put(high.words | first, words[i], t * n_pixels)
            n_equal[i, t] = tied
            split[i, t] = 0 < missing < tied
    return words, n_equal, split


class _Frame:
    """Pixels [D], and memory for a mask of 64·W pixels, zero beyond D."""

    def __init__(self, pixels: np.ndarray, room: np.ndarray) -> None:
        self.pixels = pixels
        self._room = room

    @functools.cached_property
    def sample(self) -> np.ndarray:
        """Sample of the pixels, in rising order."""
        chosen = self.pixels[_sampled(len(self.pixels))]
        return np.sort(chosen, kind="stable")  # a radix sort for up to 16 bits

    def above(self, value: int) -> Above:
        """The pixels above a value."""
        np.greater(self.pixels, value, out=self._room[: len(self.pixels)])
        words = np.packbits(self._room, bitorder="little").view(np.int64)
        return Above(value, words, count_ones(words))


def _search(frame: _Frame, wanted: int, guess: int | None) -> tuple[Above, Above]:
    """Two neighbouring values, with more pixels than wanted above the first, but not the second.

    The second value is the threshold.
    """
    n_pixels = len(frame.pixels)
    of_type = np.iinfo(frame.pixels.dtype)
    one_byte = of_type.bits == 8
    every = _all_ones(n_pixels)
    low = Above(int(of_type.min) - 1, every, n_pixels)
    high = Above(int(of_type.max), np.zeros_like(every), 0)

    def look(value: int) -> int:
        """Count above a value between the two: how many more pixels than wanted."""
        nonlocal low, high
        if not low.value < value < high.value:
            return 0
        found = frame.above(value)
        if found.n > wanted:
            low = found
        else:
            high = found
        return found.n - wanted

    if guess is not None:
        surplus = look(guess)
        if one_byte:
            look(guess + 1 if surplus > 0 else guess - 1)
    size = len(_sampled(n_pixels))
    at = size * (n_pixels - wanted) // n_pixels
    while high.value - low.value > 1:
        value = int(frame.sample[min(max(0, at), size - 1)])
        if one_byte:
            value = min(max(low.value + 1, value), high.value - 1)
        elif not low.value < value < high.value:
            value = (low.value + high.value) // 2
        off = look(value) * size / n_pixels
        at += round(off + math.copysign(1, off))
    return low, high


def _put(words: np.ndarray, row: np.ndarray, start: int) -> None:
    """Write the bits of words [W] into a row [W′] of zeros, from bit `start` on."""
    place, shift = divmod(start, bits.WORD)
    row = row[place:].view(np.uint64)
    given = words.view(np.uint64)
    row[: len(given)] |= given << np.uint64(shift)
    if shift:
        above = given >> np.uint64(bits.WORD - shift)
        room = row[1 : len(given) + 1]
        room |= above[: len(room)]


@functools.lru_cache(maxsize=4)
def _sampled(n_pixels: int) -> np.ndarray:
    """Indices of the sample: a random pixel of each stretch, so that no pattern biases it."""
    n = min(_SAMPLE, max(32, n_pixels // 16), n_pixels)
    within = np.random.default_rng(0).random(n)
    offsets = np.arange(n) + within
    return (offsets * n_pixels / n).astype(np.intp)


def _all_ones(n_pixels: int) -> np.ndarray:
    """Words int64 [W] with n_pixels ones."""
    words = np.full(bits.words_for(n_pixels), -1)
    rest = n_pixels % bits.WORD
    if rest:
        words[-1] = (1 << rest) - 1
    return words
