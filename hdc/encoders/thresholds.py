"""The threshold of a large frame, and the pixels that become ones, one frame after another.

Integers are compared with single values: one pass over a frame counts the pixels above a value,
which shows on which side the threshold lies. The threshold of the frame before is tried first, then
a sample says about where to look (Floyd and Rivest, Commun. ACM 18, 165 (1975)). Two or three
passes leave the pixels of one grey level of 8 bits. The counts of all pixels decide, so neither
changes a bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.encoders.ties import count_ones, first_ties

_SAMPLE = 4096  # pixels of a frame that are sorted, at most


class Level(NamedTuple):
    """B frames of D pixels at one threshold."""

    words: Tensor  # int64 [B, W], the ones
    n_equal: Tensor  # int64 [B], pixels that equal the threshold
    split: Tensor  # bool [B], whether some of these became ones and others did not


class _Selected(NamedTuple):
    """The pixels [D] of a frame at one threshold."""

    threshold: Any
    above: np.ndarray  # words int64 [W]
    n_above: int
    equal: np.ndarray  # words int64 [W]
    n_equal: int


def one_by_one(pixels: Tensor, ones: Sequence[int], rule: str) -> list[Level]:
    """:func:`hdc.encoders.ranks.by_torch` on the CPU, of large frames, one after another."""
    images = pixels.numpy()
    n_images, n_pixels = images.shape
    words = np.empty((len(ones), n_images, bits.words_for(n_pixels)), np.int64)
    n_equal = np.empty((len(ones), n_images), np.int64)
    split = np.empty((len(ones), n_images), np.bool_)
    room = np.zeros(words.shape[2] * bits.WORD, np.bool_)
    select = _by_order if images.dtype.kind == "f" else _by_counting
    guesses: list[Any] = [None] * len(ones)  # thresholds of the frame before
    for i, image in enumerate(images):
        selected = select(_Frame(image, room), ones, guesses)
        for t, (level, wanted) in enumerate(zip(selected, ones, strict=True)):
            missing = wanted - level.n_above
            first = first_ties(level.equal, level.n_equal, missing, rule)
            np.bitwise_or(level.above, first, out=words[t, i])
            n_equal[t, i] = level.n_equal
            split[t, i] = 0 < missing < level.n_equal
        guesses = [level.threshold for level in selected]
    parts = map(torch.from_numpy, (words, n_equal, split))
    return [Level(*level) for level in zip(*parts, strict=True)]


class _Frame:
    """Pixels [D], and room for a mask of 64·W of them, zero beyond D."""

    def __init__(self, pixels: np.ndarray, room: np.ndarray) -> None:
        self.pixels = pixels
        self._room = room

    @functools.cached_property
    def sample(self) -> np.ndarray:
        """Some of the pixels, in rising order."""
        chosen = self.pixels[_sampled(len(self.pixels))]
        return np.sort(chosen, kind="stable")  # a radix sort for up to 16 bits

    def words(self, compare: np.ufunc, value: Any) -> np.ndarray:
        """Words int64 [W] of a comparison with a value."""
        compare(self.pixels, value, out=self._room[: len(self.pixels)])
        return np.packbits(self._room, bitorder="little").view(np.int64)


def _by_order(frame: _Frame, ones: Sequence[int], _: Any) -> list[_Selected]:
    """The frame at its thresholds, for numbers of ones, by partial order."""
    n_pixels = len(frame.pixels)
    at = [min(n_pixels - wanted, n_pixels - 1) for wanted in ones]
    ordered = np.partition(frame.pixels, sorted(set(at)))
    selected = []
    for place in at:
        threshold = ordered[place]
        above = frame.words(np.greater, threshold)
        equal = frame.words(np.equal, threshold)
        counts = count_ones(above), count_ones(equal)
        selected.append(_Selected(threshold, above, counts[0], equal, counts[1]))
    return selected


def _by_counting(
    frame: _Frame, ones: Sequence[int], guesses: Sequence[int | None]
) -> list[_Selected]:
    """:func:`_by_order` of integers, by counting above some values, a guess being the first."""
    pairs = zip(ones, guesses, strict=True)
    return [_search(frame, wanted, guess) for wanted, guess in pairs]


def _search(frame: _Frame, wanted: int, guess: int | None) -> _Selected:
    """Integers at one threshold."""
    n_pixels = len(frame.pixels)
    one_byte = frame.pixels.itemsize == 1
    between = _Between(frame, wanted)
    if guess is not None:
        surplus = between.look(guess)
        if one_byte:
            between.look(guess + 1 if surplus > 0 else guess - 1)
        if between.done:
            return between.selected()
    size = len(frame.sample)
    at = size * (n_pixels - wanted) // n_pixels
    while not between.done:
        value = int(frame.sample[min(max(0, at), size - 1)])
        if not between.low < value < between.high:
            value = between.next_to(value) if one_byte else between.middle
        off = between.look(value) * size / n_pixels
        at += round(off + math.copysign(1, off))
    return between.selected()


class _Between:
    """Bounds of a threshold: more pixels than wanted are above `low`, and no more above `high`."""

    def __init__(self, frame: _Frame, wanted: int) -> None:
        n_pixels = len(frame.pixels)
        of_type = np.iinfo(frame.pixels.dtype)
        self._frame = frame
        self._wanted = wanted
        self.low = int(of_type.min) - 1
        self.high = int(of_type.max)
        self._above_low = _all_ones(n_pixels)
        self._n_above_low = n_pixels
        self._above_high = np.zeros_like(self._above_low)
        self._n_above_high = 0

    @property
    def done(self) -> bool:
        """Whether the pixels between are of one value, the threshold."""
        return self.high - self.low <= 1

    @property
    def middle(self) -> int:
        """The value that halves what is between."""
        return (self.low + self.high) // 2

    def next_to(self, value: int) -> int:
        """The value between that is nearest to one outside."""
        return self.low + 1 if value <= self.low else self.high - 1

    def look(self, value: int) -> int:
        """Count the pixels above a value, where it lies between: how many more than wanted."""
        if not self.low < value < self.high:
            return 0
        words = self._frame.words(np.greater, value)
        n = count_ones(words)
        if n > self._wanted:
            self.low, self._above_low, self._n_above_low = value, words, n
        else:
            self.high, self._above_high, self._n_above_high = value, words, n
        return n - self._wanted

    def selected(self) -> _Selected:
        """The frame at the threshold that was found."""
        equal = self._above_low ^ self._above_high
        n_equal = self._n_above_low - self._n_above_high
        n_above = self._n_above_high
        return _Selected(self.high, self._above_high, n_above, equal, n_equal)


@functools.lru_cache(maxsize=4)
def _sampled(n_pixels: int) -> np.ndarray:
    """Which pixels are the sample: one of each stretch, at random, lest they follow a pattern."""
    n = min(_SAMPLE, max(32, n_pixels // 16), n_pixels)
    within = np.random.default_rng(0).random(n)
    offsets = np.arange(n) + within
    return (offsets * n_pixels / n).astype(np.intp)


def _all_ones(n_pixels: int) -> np.ndarray:
    """Words int64 [W] of so many ones."""
    words = np.full(bits.words_for(n_pixels), -1)
    rest = n_pixels % bits.WORD
    if rest:
        words[-1] = (1 << rest) - 1
    return words
