"""The inputs of the benchmark: frames of one size, and what is right, computed in plain numpy."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.names import SHUFFLED, SORTED
from hdc.encode import encode

HELD_OUT = 16  # frames that trained models predict


def _grey(intensity: np.ndarray) -> np.ndarray:
    return np.minimum(intensity, 255).astype(np.uint8)


# Pixels made of an intensity float32 [D] of mean 50.
FRAMES: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "speckle": _grey,
    SORTED: _grey,
    SHUFFLED: _grey,
    "constant": lambda intensity: np.full(len(intensity), 128, np.uint8),
    "binary": lambda intensity: np.where(intensity > 50, 255, 0).astype(np.uint8),
    "uint16": lambda intensity: np.minimum(256 * intensity, 65535).astype(np.uint16),
    "float32": lambda intensity: intensity.astype(np.float32),
}


class Case:
    """Frames of one size, their labels, and what the reference needs, made when first asked for.

    Frames [N, D] are speckle-like: half a pattern of the class, half one of the frame's own, with
    gamma-distributed intensity of mean 50, and a brightness that varies by 1 % from frame to frame,
    as that of touches does. Those like a camera's are of six exposures, whose medians are 100 grey
    levels apart, and flicker by 5 %: one exposure after the other, or in random order.

    Args:
        n, d, n_classes: numbers of frames, pixels, classes.
        device: where torch routes run.
        seed: seed of the frames.
        kind: one of :data:`FRAMES`.
    """

    def __init__(
        self,
        n: int,
        d: int,
        n_classes: int,
        device: str = "cpu",
        seed: int = 0,
        kind: str = "speckle",
    ):
        if kind not in FRAMES:
            raise ValueError(f"task.frames: expected among {', '.join(FRAMES)}, found {kind!r}")
        self.n, self.d, self.n_classes, self.device, self.seed = n, d, n_classes, device, seed
        self.kind, self.dtype = kind, FRAMES[kind](np.zeros(1, np.float32)).dtype
        self.labels = np.arange(n) % n_classes

    @functools.cached_property
    def frames(self) -> Tensor:
        return self._frames(self.labels, 1)

    @functools.cached_property
    def few(self) -> tuple[Tensor, np.ndarray]:
        """Four frames a class: enough to make a model whose prediction is timed."""
        labels = np.arange(4 * self.n_classes) % self.n_classes
        return self._frames(labels, 2), labels

    def few_by_few(self) -> Iterator[tuple[Tensor, np.ndarray]]:
        """One frame a class, some at a time: of a thousand classes they are a quarter gigabyte."""
        labels = np.arange(self.n_classes)
        drawn = self._drawn(labels, 2)
        for some in np.array_split(labels, -(-self.n_classes // 32)):
            frames = np.fromiter(drawn, (self.dtype, self.d), len(some))
            yield torch.from_numpy(frames), some

    @functools.cached_property
    def held(self) -> tuple[Tensor, np.ndarray]:
        """Frames that no model was trained on."""
        labels = np.arange(HELD_OUT) % self.n_classes
        return self._frames(labels, 3), labels

    @functools.cached_property
    def words(self) -> Tensor:
        """Packed hypervectors int64 [N, W], made without holding all the frames."""
        words = torch.empty(self.n, -(-self.d // 64), dtype=torch.int64, device=self.device)
        for i, frame in enumerate(self._drawn(self.labels, 1)):
            words[i] = encode(torch.from_numpy(frame)[None].to(self.device))[0]
        return words

    @functools.cached_property
    def prototypes(self) -> Tensor:
        """Packed hypervectors int64 [L, W] to compare with."""
        return encode(self._frames(np.arange(self.n_classes), 4).to(self.device))

    def _frames(self, labels: np.ndarray, stream: int) -> Tensor:
        frames = np.fromiter(self._drawn(labels, stream), (self.dtype, self.d), len(labels))
        return torch.from_numpy(frames)

    def _drawn(self, labels: np.ndarray, stream: int) -> Iterator[np.ndarray]:
        """One frame [D] after another."""
        own, n = np.random.default_rng([self.seed, stream]), len(labels)
        pools, more = [], min(15 * self.d, 2**22)  # stretches of which are patterns
        for number, count in ((0, self.n_classes), (stream, n)):
            rng = np.random.default_rng([self.seed, number, 1])
            pool = rng.standard_gamma(3, self.d + more, np.float32)
            pools.append((pool, rng.integers(0, more + 1, count)))
        (base, places), (pool, starts) = pools
        if self.kind in (SORTED, SHUFFLED):
            exposures = np.linspace(33, 133, 6) / 50 * 1.06  # of the mean, whose median is lower
            gains = np.sort(own.choice(exposures, n)) * own.uniform(0.95, 1.05, n)
            if self.kind == SHUFFLED:
                gains = own.permutation(gains)
        else:
            gains = 1 + 0.01 * own.standard_normal(n)
        gains = (50 / 3 / 2 * gains).astype(np.float32)
        for label, start, gain in zip(labels, starts, gains, strict=True):
            pattern = base[places[label] :][: self.d] + pool[start : start + self.d]
            yield FRAMES[self.kind](gain * pattern)

    # The reference, in numpy alone ---------------------------------------------------------------

    def verdict(self, operation: str, result: np.ndarray) -> str:
        """What a result in common form is worth: ``yes``, ``yes, ties aside`` (bits that the median
        or the majority leaves open), ``same labels`` (the right ones), or ``no``."""
        if operation == "folder":
            operation = "train"
        if operation == "hamming":
            return "yes" if np.array_equal(result, self.distances) else "no"
        if result.dtype != np.uint8:
            return "same labels" if np.array_equal(result, self.held[1]) else "no"
        expected, free = getattr(self, f"expected_{operation}")
        if result.shape != expected.shape:
            return "no"
        if all(map(np.array_equal, result, expected)):
            return "yes"
        rows = zip(result, expected, free, strict=True)
        return "no" if any(((a ^ b) & ~ties).any() for a, b, ties in rows) else "yes, ties aside"

    @functools.cached_property
    def expected_encode(self) -> tuple[np.ndarray, np.ndarray]:
        """Packed bits, and which pixels equal their frame's median: others have no choice."""
        expected = np.empty((self.n, -(-self.d // 8)), np.uint8)
        ties = np.empty_like(expected)
        for i, pixels in enumerate(self.frames.numpy()):
            passed, equal = _threshold(pixels)
            expected[i], ties[i] = pack_bits(passed), pack_bits(equal)
        return expected, ties

    @functools.cached_property
    def expected_bundle(self) -> tuple[np.ndarray, np.ndarray]:
        """Prototypes of the words, and the bits that as many samples have as have not."""
        packed, n = packed_bytes(self.words, self.d), self._sizes
        counts = np.zeros((self.n_classes, self.d), np.int32)
        for label, row in zip(self.labels, packed, strict=True):
            counts[label] += unpack_bits(row, self.d)
        return pack_bits(2 * counts > n), pack_bits(2 * counts == n)

    @functools.cached_property
    def expected_train(self) -> tuple[np.ndarray, np.ndarray]:
        """Prototypes of the frames, and the bits that hang on how ties are split."""
        counts, low, high = np.zeros((3, self.n_classes, self.d), np.int32)
        for pixels, label in zip(self.frames.numpy(), self.labels, strict=True):
            passed, equal = _threshold(pixels)
            counts[label] += passed
            low[label] += passed & ~equal
            high[label] += passed | equal
        n = self._sizes
        return pack_bits(2 * counts > n), pack_bits((2 * low <= n) & (2 * high >= n))

    @functools.cached_property
    def distances(self) -> np.ndarray:
        ones = unpack_bits(packed_bytes(self.words, self.d), self.d)
        prototypes = unpack_bits(packed_bytes(self.prototypes, self.d), self.d)
        return np.stack([(ones != p).sum(1) for p in prototypes], 1)

    @property
    def _sizes(self) -> np.ndarray:
        """Samples a class, [L, 1]."""
        return np.bincount(self.labels, minlength=self.n_classes)[:, None]


def _threshold(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels [D] are ones, exactly half, and which equal the median: the first of them are
    ones as well, as many as are wanting."""
    ones = len(pixels) // 2
    level = np.partition(pixels, len(pixels) - ones)[len(pixels) - ones]
    passed, equal = pixels > level, pixels == level
    passed[np.flatnonzero(equal)[: ones - int(passed.sum())]] = True
    return passed, equal


def pack_bits(mask: np.ndarray | Tensor) -> np.ndarray:
    """Bool [..., D] → uint8 [..., ⌈D/8⌉], the common form of hypervectors."""
    mask = mask.numpy(force=True) if isinstance(mask, Tensor) else mask
    return np.packbits(mask, axis=-1, bitorder="little")


def unpack_bits(packed: np.ndarray, d: int) -> np.ndarray:
    return np.unpackbits(packed, axis=-1, count=d, bitorder="little").view(np.bool_)


def packed_bytes(words: Tensor, d: int) -> np.ndarray:
    """Our words [..., W] in common form."""
    return words.numpy(force=True).view(np.uint8)[..., : -(-d // 8)]
