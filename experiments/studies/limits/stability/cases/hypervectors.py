"""Packed hypervectors: bits, distances, majority and counters; references are the definition of a
hypervector, and integers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.limits.stability.case import case, differing
from hdc import HDCClassifier, bits
from hdc.encoders import Median
from hdc.prototypes import Counters

D = 250_000  # pixels of a frame in the paper


hypervector_case = partial(case, "hypervectors")


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def random_bits(n: int, d: int) -> Tensor:
    """Random bits, bool [n, d]."""
    drawn = random().integers(0, 2, (n, d), dtype=np.uint8)
    return torch.from_numpy(drawn.view(bool))


def counted(
    words: Tensor,
    d: int,
    labels: Tensor,
) -> Counters:
    """Counters of these hypervectors."""
    counters = Counters(int(labels.max()) + 1, d)
    counters.add(words, labels)
    return counters


FRAMES: tuple[tuple[str, str, Callable[[int], np.ndarray], str], ...] = (
    ("with ties at the median", "8-bit speckle: some 3,000 of 250,000 pixels equal the median",
     lambda d: random().gamma(2, 25, d).round().clip(0, 255), "uint8"),  # two polarisations
    ("of a constant frame", "every pixel is 128", lambda d: np.full(d, 128), "uint8"),
    ("of a saturated frame", "overexposed: more than 60 % of the pixels are 255",
     lambda d: np.where(np.arange(d) < 6 * d // 10, 255, random().gamma(2, 255, d).clip(0, 255)),
     "uint8"),
    ("of a dark frame", "underexposed: 70 % of the pixels are 0",
     lambda d: random().permutation(
         np.pad(random().integers(1, 9, 3 * d // 10), (0, d - 3 * d // 10))), "uint8"),
    ("of a two-valued frame", "two values only, 0 and 255, 40 % of them 255",
     lambda d: (random().random(d) < 0.4) * 255, "uint8"),
    ("of signed pixels",
     "int16 from -3 to 3, as after a dark frame was subtracted: a seventh equals the median",
     lambda d: random().integers(-3, 4, d), "int16"),
    ("of subnormal pixels", "float32 of 1 to 9 times 1.4·10^-45, the smallest number there is",
     lambda d: random().integers(1, 10, d) * 2.0**-149, "float32"),
    ("of signed zeros", "float32 zeros, half of them negative: equal, though their bits differ",
     lambda d: np.where(np.arange(d) % 2, -0.0, 0.0), "float32"),
    ("of 4-bit pixels", "16 grey levels: a sixteenth of the pixels equals the median",
     lambda d: random().integers(0, 16, d), "uint8"),
    ("of 16-bit pixels", "uint16 over its whole range: torch has no median of that type",
     lambda d: random().integers(0, 65_536, d), "uint16"),
    ("of 64-bit pixels", "uint64 just below 2^64: as int64 negative, as float64 all equal",
     lambda d: np.uint64(2**64 - 1) - random().integers(0, 100, d).astype(np.uint64), "uint64"),
    ("of half-precision pixels", "float16 around 50,000: its numbers are 32 apart",
     lambda d: random().normal(50_000, 1000, d), "float16"),
    ("of coarse float pixels", "float32 with 8 bits of mantissa: half a percent apart",
     lambda d: torch.from_numpy(random().gamma(2, 25, d)).bfloat16().float().numpy(), "float32"),
    ("of one bright pixel", "all pixels but one are equal: the median is the minimum",
     lambda d: np.arange(d) == d - 1, "uint8"),
    ("of one dark pixel", "all pixels but one are equal: the median is the maximum",
     lambda d: np.arange(d) > 0, "uint8"),
    ("of huge and tiny pixels", "float64 of 10^-300 and 10^300: their ratio overflows",
     lambda d: np.where(random().random(d) < 0.4, 1e300, 1e-300), "float64"),
    ("of a staircase", "sorted pixels, 999 equal ones after another",
     lambda d: np.arange(d) // 999, "int32"),
    ("of three levels", "49 % of the pixels are 0, 2 % are 1: the median is a rare level",
     lambda d: np.searchsorted([0.49, 0.51], random().random(d)), "uint8"),
)  # fmt: skip


def violations(ones: np.ndarray, pixels: np.ndarray) -> int:
    """Bits that break the definition of a hypervector: bool [2, D] of a frame [D] and of a constant
    one, where every pixel ties.

    Exactly k = ⌊D/2⌋ pixels are ones; with the k-th largest value m, those above m are ones and
    those below m zeros; and ties go by one order of the pixels, the same for all frames. So the
    ties that become ones in either frame contain those of the other, among the pixels that tie in
    both.
    """
    k = len(pixels) // 2
    m = np.sort(pixels)[len(pixels) - k]
    of_frame, of_constant = ones
    wrong = np.count_nonzero(~of_frame & (pixels > m))
    wrong += np.count_nonzero(of_frame & (pixels < m))
    for bits_of_one in ones:
        wrong += abs(int(bits_of_one.sum()) - k)
    tied = pixels == m
    only_here = np.count_nonzero(tied & of_frame & ~of_constant)
    only_there = np.count_nonzero(tied & of_constant & ~of_frame)
    return int(wrong + min(only_here, only_there))


def definition(
    make: Callable[[int], np.ndarray],
    dtype: str,
    d: int = D,
) -> Any:
    """A frame and a constant one: their bits by comparison with the median, and by the encoder."""
    frame = torch.from_numpy(make(d).astype(dtype))
    both = torch.stack([frame, frame[:1].expand(d)])

    def naive() -> np.ndarray:
        above = [row > row.median() for row in both]
        return torch.stack(above).numpy()

    def ours() -> np.ndarray:
        words = Median().encode(both)
        return bits.unpack(words, d).numpy().astype(bool)

    return naive, ours, frame.numpy()


for _name, _extreme, _pixels, _dtype in FRAMES:
    hypervector_case(
        _extreme,
        "pixel > median",
        "hdc.encoders.Median",
        "bits",
        name=f"definition {_name}",
        error=violations,
    )(partial(definition, _pixels, _dtype))


def tail_bits(d: int) -> Any:
    """Ones of a prototype whose bits are all tied, so that it is all ones: as many as D."""
    mask = random_bits(1, d)
    pair = bits.pack(torch.cat((mask, ~mask)))

    def naive() -> Tensor:
        complement = ~bits.majority(pair, "zero")
        return bits.count_ones(complement[None])

    def ours() -> Tensor:
        words = bits.majority(pair, "one")
        return bits.count_ones(words[None])

    return naive, ours, d


for _d in (1, 3, 63, 65, 127, 129, 1000, D):
    hypervector_case(
        f"D = {_d:,}: a complement also sets bits beyond the last pixel",
        "~majority(words, ties to zero)",
        "hdc.bits.majority(words, 'one')",
        "bits",
        name=f"tail bits of {_d:,} pixels",
    )(partial(tail_bits, _d))


@hypervector_case(
    "opposite hypervectors: sums of bits kept in bytes wrap at 256",
    "numpy.bitwise_count, summed in uint8",
    "hdc.bits.hamming",
    "bits",
)
def distances_above_255(d: int = D) -> Any:
    mask = random_bits(1, d)
    a, b = bits.pack(mask), bits.pack(~mask)

    def naive() -> np.uint8:
        differing = (a ^ b).numpy().view(np.uint64)
        return np.bitwise_count(differing).sum(dtype=np.uint8)

    return naive, partial(bits.hamming, a, b), d


@hypervector_case(
    "50 of 51 prototypes equally near to every query: the lowest index is expected",
    "topk(1, largest=False)",
    "HDCClassifier.predict",
    "queries",
    error=differing,
)
def hamming_ties(d: int = 1024) -> Any:
    drawn = random().integers(0, 256, (2, d), dtype=np.uint8)
    frames = torch.from_numpy(drawn)
    one_and_fifty = [0] + [1] * 50
    model = HDCClassifier().fit(frames[one_and_fifty], np.arange(51))
    queries = frames[1:].repeat(20, 1)
    distances = torch.from_numpy(model.distances(queries))

    def naive() -> Tensor:
        nearest = distances.topk(1, largest=False)
        return nearest.indices[:, 0]

    return naive, partial(model.predict, queries), 1


@hypervector_case(
    "70,000 samples in a class: 16-bit counters wrap at 2^16",
    "uint16 counters",
    "hdc.prototypes.Counters",
    "counts",
)
def counters_above_2_to_the_16(n: int = 70_000, d: int = 1000) -> Any:
    # How often each bit is set.
    ones = [round(n * share) for share in np.linspace(0, 1, d)]
    sample = np.arange(n)
    mask = sample[:, None] < np.array(ones)
    words = bits.pack(torch.from_numpy(mask))
    labels = torch.zeros(n, dtype=torch.int64)

    def ours() -> Tensor:
        (counts,) = counted(words, d, labels).counts()
        return counts

    return partial(mask.sum, 0, dtype=np.uint16), ours, ones


@hypervector_case(
    "classes of 1, 2 and 997 samples: one threshold for all empties the small ones",
    "count > N / (2 L)",
    "Counters.majority",
    "bits",
    error=differing,
)
def unequal_classes(d: int = 10_000) -> Any:
    sizes = torch.tensor([1, 2, 997])
    labels = torch.repeat_interleave(torch.arange(3), sizes)
    mask = random_bits(1000, d)
    words = bits.pack(mask)
    of_classes = [mask[labels == c].sum(0) for c in range(3)]
    counts = torch.stack(of_classes)

    def naive() -> Tensor:
        return counts > len(labels) / 6

    def ours() -> Tensor:
        prototypes = counted(words, d, labels).majority()
        return bits.unpack(prototypes, d)

    return naive, ours, 2 * counts > sizes[:, None]
