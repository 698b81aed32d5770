"""Frames of one size, and the right result of an operation on them, computed in plain numpy."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from hdc.encoders import Median

HELD_OUT = 16  # frames that trained models predict


@dataclass
class Case:
    """Frames uint8 for one operation, made when first used.

    Frames [N, D] are speckle-like: half a pattern of the class, half one of the frame alone, with
    gamma-distributed intensity of mean 50, and a brightness that varies by 1 % from frame to frame.
    """

    operation: str
    n: int  # frames
    d: int  # pixels
    l: int  # noqa: E741  (classes)
    device: str = "cpu"  # a GPU has routes of its own

    def __post_init__(self):
        self.labels = np.arange(self.n) % self.l

    @cached_property
    def pixels(self):
        """Frames [N, D], input of the operation."""
        return self._made(self.labels, 1)

    @cached_property
    def examples(self):
        """One frame per class [L, D], to learn or to compare with."""
        return self._made(np.arange(self.l), 2)

    @cached_property
    def held_out(self):
        """Frames [16, D] that no model is trained on, of classes 0 … L − 1 in turn."""
        return self._made(np.arange(HELD_OUT) % self.l, 3)

    @cached_property
    def words(self):
        """Packed hypervectors int64 [N, W] of the frames."""
        return Median().encode(self.pixels)

    @cached_property
    def prototypes(self):
        """Packed hypervectors int64 [L, W] of the examples."""
        return Median().encode(self.examples)

    @cached_property
    def folder(self):
        """The frames on disk, class by class: CLASS/*.png."""
        import cv2

        self._temporary = tempfile.TemporaryDirectory()  # it goes when the case goes
        folder, side = Path(self._temporary.name), math.isqrt(self.d)
        for k, (frame, label) in enumerate(zip(self.pixels, self.labels, strict=True)):
            (folder / str(label)).mkdir(exist_ok=True)
            path = folder / str(label) / f"{k}.png"
            cv2.imwrite(str(path), frame.view(side, side).numpy())
        return folder

    def _made(self, labels, stream):
        """Frames [n, D]; every pattern is a stretch of one long random sequence."""
        n, spare = len(labels), min(15 * self.d, 2**22)
        of_sequence = np.random.default_rng(0)
        sequence = of_sequence.standard_gamma(3, self.d + spare, np.float32)
        of_classes = np.random.default_rng([0, 0]).integers(0, spare, self.l)
        of_frames = np.random.default_rng([0, stream])
        gains = 1 + 0.01 * of_frames.standard_normal(n)
        frames = np.empty((n, self.d), np.uint8)
        starts = of_frames.integers(0, spare, n)
        for k, (start, of_class) in enumerate(
            zip(starts, of_classes[labels], strict=True)
        ):
            pattern = sequence[of_class:][: self.d] + sequence[start:][: self.d]
            grey = np.float32(gains[k] * 50 / 3 / 2) * pattern
            frames[k] = np.minimum(grey, 255)
        return torch.from_numpy(frames)

    def verdict(self, result):
        """Compare a result in common form with the reference, which is computed in numpy alone.

        ``yes, ties aside``: other bits only where the median or the majority leaves them open.
        """
        if self.operation == "hamming":
            queries = unpack_bits(self.words, self.d)
            prototypes = unpack_bits(self.prototypes, self.d)
            distances = [(queries != one).sum(1) for one in prototypes]
            right = np.array_equal(result, np.stack(distances, 1))
            return "yes" if right else "no"
        if self.operation == "predict":
            labels = np.arange(HELD_OUT) % self.l
            return "same labels" if np.array_equal(result, labels) else "no"
        expected, free = self.expected
        if result.shape != expected.shape:
            return "no"
        differing = result ^ expected
        if (differing & ~free).any():
            return "no"
        return "yes" if np.array_equal(result, expected) else "yes, ties aside"

    @cached_property
    def expected(self):
        """Packed bits of the result, and the bits that ties leave open."""
        if self.operation == "encode":
            rows = [threshold(frame) for frame in self.pixels.numpy()]
            passed_of_all, equal_of_all = zip(*rows, strict=True)
            return pack_bits(np.stack(passed_of_all)), pack_bits(np.stack(equal_of_all))
        low, ones, high = np.zeros((3, self.l, self.d), np.int32)
        for frame, label in zip(self.pixels.numpy(), self.labels, strict=True):
            passed, equal = threshold(frame)
            if self.operation == "bundle":
                # Of hypervectors, which have no ties any more.
                equal = np.zeros_like(equal)
            ones[label] += passed
            low[label] += passed & ~equal
            high[label] += passed | equal
        n = np.bincount(self.labels, minlength=self.l)[:, None]
        free = (2 * low <= n) & (2 * high >= n)
        return pack_bits(2 * ones > n), pack_bits(free)


def threshold(pixels):
    """Exactly half of the pixels [D] as ones, and the pixels that equal the median.

    As many of those become ones as are needed, pixel 64·w + b by the key ((b + h(w)) mod 64, w)
    with h(w) = (w·0x9E3779B1 mod 2³²) >> 26.
    """
    ones = len(pixels) // 2
    zeros = len(pixels) - ones
    level = np.partition(pixels, zeros)[zeros]
    passed, equal = pixels > level, pixels == level
    ties = np.flatnonzero(equal)
    word, bit = np.divmod(ties, 64)
    rotation = (word * 0x9E3779B1 % 2**32) >> 26
    turn = (bit + rotation) % 64
    in_order = ties[np.lexsort((word, turn))]
    missing = ones - int(passed.sum())
    passed[in_order[:missing]] = True
    return passed, equal


def pack_bits(mask):
    """Bool [..., D] → uint8 [..., ⌈D/8⌉], the common form of hypervectors."""
    return np.packbits(mask, axis=-1, bitorder="little")


def unpack_bits(words, d):
    """Packed words [..., W] → bool [..., D]."""
    packed = words.numpy().view(np.uint8)
    ones = np.unpackbits(packed, axis=-1, count=d, bitorder="little")
    return ones.view(np.bool_)
