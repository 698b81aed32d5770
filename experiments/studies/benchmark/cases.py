"""Frames of one size, and the right result of an operation on them, computed in plain numpy."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from hdc.encoders import Median

RATE_HZ = 30  # of videos
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
    seed: int = 0

    def __post_init__(self) -> None:
        self.labels = np.arange(self.n) % self.l

    @cached_property
    def pixels(self) -> Tensor:
        """Frames [N, D], input of the operation."""
        return self._made(self.labels, 1)

    @cached_property
    def examples(self) -> Tensor:
        """One frame a class [L, D], to learn or to compare with."""
        return self._made(np.arange(self.l), 2)

    @cached_property
    def held_out(self) -> Tensor:
        """Frames [16, D] that no model is trained on, of classes 0 … L − 1 in turn."""
        return self._made(np.arange(HELD_OUT) % self.l, 3)

    @cached_property
    def words(self) -> Tensor:
        """Packed hypervectors int64 [N, W] of the frames."""
        return Median().encode(self.pixels)

    @cached_property
    def prototypes(self) -> Tensor:
        """Packed hypervectors int64 [L, W] of the examples."""
        return Median().encode(self.examples)

    @cached_property
    def folder(self) -> Path:
        """The frames on disk, class by class: images/CLASS/*.png, and video.avi, lossless."""
        import cv2

        self._temporary = tempfile.TemporaryDirectory()  # it goes when the case goes
        folder, size = Path(self._temporary.name), (math.isqrt(self.d),) * 2
        lossless = cv2.VideoWriter.fourcc(*"FFV1")
        video = cv2.VideoWriter(
            str(folder / "video.avi"), lossless, RATE_HZ, size, isColor=False
        )
        lines, first = ["start_s,end_s,label"], 0
        for c, n in enumerate(np.bincount(self.labels)):
            (folder / "images" / str(c)).mkdir(parents=True)
            for k, frame in enumerate(self.pixels.numpy()[self.labels == c]):
                cv2.imwrite(
                    str(folder / "images" / str(c) / f"{k}.png"), frame.reshape(size)
                )
                video.write(frame.reshape(size))
            lines.append(f"{first / RATE_HZ},{(first + n) / RATE_HZ},{c}")
            first += n
        video.release()
        (folder / "video.csv").write_text("\n".join(lines))
        return folder

    def _made(self, labels: np.ndarray, stream: int) -> Tensor:
        frames = np.fromiter(
            self._drawn(labels, stream), (np.uint8, self.d), len(labels)
        )
        return torch.from_numpy(frames)

    def _drawn(
        self,
        labels: np.ndarray,
        stream: int,
    ) -> Iterator[np.ndarray]:
        """One frame [D] after another; every pattern is a stretch of one long random sequence."""
        n, spare = len(labels), min(15 * self.d, 2**22)
        patterns = np.random.default_rng(self.seed).standard_gamma(
            3, self.d + spare, np.float32
        )
        of_class = np.random.default_rng([self.seed, 0]).integers(0, spare, self.l)
        rng = np.random.default_rng([self.seed, stream])
        gains = 1 + 0.01 * rng.standard_normal(n)
        for label, start, gain in zip(
            labels, rng.integers(0, spare, n), gains, strict=True
        ):
            pattern = patterns[of_class[label] :][: self.d] + patterns[start:][: self.d]
            yield np.minimum(np.float32(gain * 50 / 3 / 2) * pattern, 255).astype(
                np.uint8
            )

    def verdict(self, result: np.ndarray) -> str:
        """Compare a result in common form with the reference, which is computed in numpy alone.

        ``yes, ties aside``: other bits only where the median or the majority leaves them open.
        """
        if self.operation == "hamming":
            q, p = (unpack_bits(x, self.d) for x in (self.words, self.prototypes))
            distances = np.stack([(q != prototype).sum(1) for prototype in p], 1)
            return "yes" if np.array_equal(result, distances) else "no"
        if self.operation == "predict":
            right = np.array_equal(result, np.arange(HELD_OUT) % self.l)
            return "same labels" if right else "no"
        expected, free = self.expected
        if result.shape != expected.shape or ((result ^ expected) & ~free).any():
            return "no"
        return "yes" if np.array_equal(result, expected) else "yes, ties aside"

    @cached_property
    def expected(self) -> tuple[np.ndarray, np.ndarray]:
        """Packed bits of the result, and the bits that ties leave open."""
        if self.operation == "encode":
            rows = [tuple(map(pack_bits, threshold(x))) for x in self.pixels.numpy()]
            passed, equal = zip(*rows, strict=True)
            return np.stack(passed), np.stack(equal)
        low, ones, high = np.zeros((3, self.l, self.d), np.int32)
        for frame, label in zip(self.pixels.numpy(), self.labels, strict=True):
            passed, equal = threshold(frame)
            if (
                self.operation == "bundle"
            ):  # of hypervectors, which have no ties any more
                equal = np.zeros_like(equal)
            ones[label] += passed
            low[label] += passed & ~equal
            high[label] += passed | equal
        n = np.bincount(self.labels, minlength=self.l)[:, None]
        return pack_bits(2 * ones > n), pack_bits((2 * low <= n) & (2 * high >= n))


def threshold(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Exactly half of the pixels [D] as ones, and the pixels that equal the median.

    Of those as many become ones as are needed, pixel 64·w + b by the key ((b + h(w)) mod 64, w)
    with h(w) = (w·0x9E3779B1 mod 2³²) >> 26.
    """
    ones = len(pixels) // 2
    level = np.partition(pixels, len(pixels) - ones)[len(pixels) - ones]
    passed, equal = pixels > level, pixels == level
    ties = np.flatnonzero(equal)
    word, bit = np.divmod(ties, 64)
    turn = (bit + ((word * 0x9E3779B1 % 2**32) >> 26)) % 64
    in_order = ties[np.lexsort((word, turn))]
    passed[in_order[: ones - int(passed.sum())]] = True
    return passed, equal


def pack_bits(mask: np.ndarray) -> np.ndarray:
    """Bool [..., D] → uint8 [..., ⌈D/8⌉], the common form of hypervectors."""
    return np.packbits(mask, axis=-1, bitorder="little")


def unpack_bits(words: Tensor, d: int) -> np.ndarray:
    """Packed words [..., W] → bool [..., D]."""
    packed = words.numpy().view(np.uint8)
    return np.unpackbits(
        packed,
        axis=-1,
        count=d,
        bitorder="little",
    ).view(np.bool_)
