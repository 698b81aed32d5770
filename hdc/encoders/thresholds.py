"""The threshold of a frame, and the pixels that become ones: three implementations, equal bits.

Small frames and floats are partially ordered, many at once. Large frames of integers are compared
with single values: one pass over a frame counts the pixels above a value, which shows on which side
the threshold lies. The threshold of the frame before is tried first, then a sample says
about where to look (Floyd and Rivest, Commun. ACM 18, 165 (1975)). Two or three passes leave the
pixels of one grey level of 8 bits. The counts of all pixels decide, so neither changes a bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.encoders.ties import count_ones, first_ties, in_order

# Pixels of several frames ordered at once, at up to 30 bytes each. A GPU is idle with fewer.
_STEP, _STEP_ON_GPU = 2**20, 2**25
_SMALL = 4096
"""Pixels per frame up to which that is faster than one frame after another."""
_BLOCK = 16  # frames that are counted one after another, the bits of each being kept
_SAMPLE = 4096  # pixels of a frame that are sorted, at most


class Level(NamedTuple):
    """B frames of D pixels at one threshold."""

    words: Tensor  # int64 [B, W], the ones
    n_equal: Tensor  # int64 [B], pixels that equal the threshold
    split: Tensor  # bool [B], whether some of these became ones and others did not


Route = Callable[[Tensor, Sequence[int], str], list[Level]]


def route_of(frames: Tensor, n_pixels: int) -> tuple[int, Route]:
    """How many such frames to take at once, and the function that does it in the least time.

    It makes levels of pixels [B, D], numbers of ones, and a rule of ties.
    """
    if frames.device.type != "cpu":
        return max(1, _STEP_ON_GPU // n_pixels), by_torch
    if n_pixels > _SMALL:
        return _BLOCK, one_by_one
    return max(1, _STEP // n_pixels), by_partition


# Many frames at once -----------------------------------------------------------------------------


def by_torch(pixels: Tensor, ones: Sequence[int], rule: str) -> list[Level]:
    """Levels of pixels [B, D] on any device, one per number of ones."""
    if pixels.dtype == torch.uint64:  # the same order, without the wrap at 2^63
        pixels = pixels.view(torch.int64) ^ torch.iinfo(torch.int64).min
    elif not pixels.is_floating_point() and pixels.dtype != torch.uint8:
        pixels = pixels.long()  # torch compares and selects few other unsigned types
    n_pixels = pixels.shape[1]
    order = _order_on(pixels.device, n_pixels, rule)
    levels = []
    for wanted in ones:
        threshold = _kth(pixels, _place(n_pixels, wanted))
        mask, n_equal, split = _ones_of(pixels, threshold, wanted, rule, order)
        levels.append(Level(bits.pack(mask), n_equal, split))
    return levels


def by_partition(pixels: Tensor, ones: Sequence[int], rule: str) -> list[Level]:
    """:func:`by_torch` on the CPU, by numpy."""
    images = pixels.numpy()
    if images.dtype.kind in "iu" and images.itemsize < 4:
        images = images.astype(np.int32)  # which numpy orders in less time
    n_pixels = images.shape[1]
    order = in_order(n_pixels, rule)
    at = [_place(n_pixels, wanted) for wanted in ones]
    ordered = np.partition(images, sorted(set(at)), axis=1)
    levels = []
    for wanted, place in zip(ones, at, strict=True):
        threshold = ordered[:, place, None]
        found = _ones_of(images, threshold, wanted, rule, order)
        mask, n_equal, split = map(torch.from_numpy, found)
        levels.append(Level(bits.pack(mask), n_equal, split))
    return levels


def _ones_of(
    pixels: Any, threshold: Any, wanted: int, rule: str, order: Any
) -> tuple[Any, Any, Any]:
    """Mask [B, D] of the pixels that become ones, and the counts of :class:`Level`.

    Args:
        pixels, threshold: [B, D] and [B, 1], tensors or arrays.
        wanted: ones of a frame.
        rule, order: of ties, and the pixels :func:`hdc.encoders.ties.in_order` of it.
    """
    above = pixels > threshold
    equal = pixels == threshold
    n_equal = equal.sum(1)
    missing = wanted - above.sum(1)
    split = (missing > 0) & (missing < n_equal)
    if wanted == 0:
        return above, n_equal, split
    if rule == "below":
        return above | (equal & ~split[:, None]), n_equal, split
    if not split.any():
        return above | equal, n_equal, split
    pixels_in_order, places = order
    ties = _first(_taken(equal, pixels_in_order), missing)
    return above | _taken(ties, places), n_equal, split


def _first(rows: Any, n: Any) -> Any:
    """The first n [B] ones of each row of bool [B, D]."""
    if isinstance(rows, np.ndarray):
        counted = rows.cumsum(1, dtype=np.int32)  # int64 takes twice as long
        return rows & (counted <= n.astype(np.int32)[:, None])
    return rows & (rows.cumsum(1, dtype=torch.int32) <= n[:, None])


def _taken(rows: Any, columns: Any) -> Any:
    """Some columns of rows [B, D]."""
    if isinstance(rows, np.ndarray):
        return rows.take(columns, 1)  # indexing takes ten times as long
    return rows.index_select(1, columns)


@functools.lru_cache(maxsize=4)
def _order_on(device: torch.device, n_pixels: int, rule: str) -> tuple[Tensor, ...]:
    """:func:`hdc.encoders.ties.in_order` in the memory of a device."""
    arrays = in_order(n_pixels, rule)
    return tuple(torch.from_numpy(array).to(device) for array in arrays)


def _place(n_pixels: int, wanted: int) -> int:
    """Which pixel in rising order is the threshold."""
    return min(n_pixels - wanted, n_pixels - 1)


def _kth(rows: Any, k: int) -> Any:
    """The value at place k of each row [B, D] in rising order, [B, 1]."""
    if isinstance(rows, np.ndarray):
        return np.partition(rows, k, axis=1)[:, k, None]
    return rows.kthvalue(k + 1, dim=1, keepdim=True).values


# One frame after another -------------------------------------------------------------------------


class _Selected(NamedTuple):
    """The pixels [D] of a frame at one threshold."""

    threshold: Any
    above: np.ndarray  # words int64 [W]
    n_above: int
    equal: np.ndarray  # words int64 [W]
    n_equal: int


def one_by_one(pixels: Tensor, ones: Sequence[int], rule: str) -> list[Level]:
    """:func:`by_torch` on the CPU, of large frames, one after another."""
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
    at = [_place(n_pixels, wanted) for wanted in ones]
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
