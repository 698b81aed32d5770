"""Frames of one size, and the right result of an operation on them."""

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
        """Frames [n, D]."""
        shape = self.l, self.d
        of_classes = np.random.default_rng(0).standard_gamma(3, shape, np.float32)
        random = np.random.default_rng([0, stream])
        frames = np.empty((len(labels), self.d), np.uint8)
        for frame, label in zip(frames, labels, strict=True):
            pattern = of_classes[label] + random.standard_gamma(3, self.d, np.float32)
            gain = 1 + 0.01 * random.standard_normal()
            frame[:] = np.minimum(np.float32(gain * 50 / 3 / 2) * pattern, 255)
        return torch.from_numpy(frames)

    def verdict(self, result):
        """Compare a result in common form with the reference, made from the bits of the numpy
        backend, which tests/hdc compares with their definition.

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
        """Packed bits of the result, and the bits that ties leave open: those of pixels that equal
        the least of the brighter half."""
        ones = unpack_bits(self.words, self.d)
        pixels = self.pixels.numpy()
        level = np.where(ones, pixels, 255).min(1, keepdims=True)
        equal = pixels == level
        if self.operation == "encode":
            return pack_bits(ones), pack_bits(equal)
        if self.operation == "bundle":
            equal[:] = False  # hypervectors have no ties any more
        parts = (ones & ~equal, ones, ones | equal)
        low, middle, high = (
            np.stack([part[self.labels == label].sum(0) for label in range(self.l)])
            for part in parts
        )
        n = np.bincount(self.labels, minlength=self.l)[:, None]
        free = (2 * low <= n) & (2 * high >= n)
        return pack_bits(2 * middle > n), pack_bits(free)


def pack_bits(mask):
    """Bool [..., D] → uint8 [..., ⌈D/8⌉], the common form of hypervectors."""
    return np.packbits(mask, axis=-1, bitorder="little")


def unpack_bits(words, d):
    """Packed words [..., W] → bool [..., D]."""
    packed = words.numpy().view(np.uint8)
    ones = np.unpackbits(packed, axis=-1, count=d, bitorder="little")
    return ones.view(np.bool_)
