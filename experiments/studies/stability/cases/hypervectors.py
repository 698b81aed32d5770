"""Packed hypervectors: balance, distances, majority and counters; the reference is integers."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.stability.case import case, differing
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters

D = 250_000  # pixels of a frame in the paper


def hypervector_case(extreme: str, naive: str, ours: str, unit: str = "bits", **rest: Any) -> Any:
    return case("hypervectors", extreme, naive, ours, unit, **rest)


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def random_bits(n: int, d: int) -> Tensor:
    """Random bits, bool [n, d]."""
    return torch.from_numpy(random().integers(0, 2, (n, d), dtype=np.uint8).view(bool))


def counted(words: Tensor, d: int, labels: Tensor | None = None, classes: int = 1) -> Counters:
    """Counters of these hypervectors."""
    counters = Counters(classes, d)
    counters.add(words, torch.zeros(len(words), dtype=torch.int64) if labels is None else labels)
    return counters


# Balance ------------------------------------------------------------------------------------------


def saturated(d: int) -> np.ndarray:
    return np.where(np.arange(d) < 6 * d // 10, 255, random().gamma(2, 255, d).clip(0, 255))


def dark(d: int) -> np.ndarray:
    pixels = np.zeros(d)
    pixels[: 3 * d // 10] = random().integers(1, 9, 3 * d // 10)
    return random().permutation(pixels)


FRAMES: tuple[tuple[str, str, Callable[[int], np.ndarray], str], ...] = (
    ("with ties at the median", "8-bit speckle: some 3,000 of 250,000 pixels equal the median",
     lambda d: random().gamma(2, 25, d).round().clip(0, 255), "uint8"),  # two polarisations
    ("of a constant frame", "every pixel is 128", lambda d: np.full(d, 128), "uint8"),
    ("of a saturated frame", "overexposed: more than 60 % of the pixels are 255", saturated,
     "uint8"),
    ("of a dark frame", "underexposed: 70 % of the pixels are 0", dark, "uint8"),
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


def balance(pixels: Callable[[int], np.ndarray], dtype: str, d: int = D) -> Any:
    """Ones of a frame's hypervector against ⌊D/2⌋."""
    frame = torch.from_numpy(pixels(d).astype(dtype))
    return (
        lambda: (frame > frame.median()).sum(),
        lambda: bits.count_ones(encode(frame[None])),
        d // 2,
    )


for _name, _extreme, _pixels, _dtype in FRAMES:
    hypervector_case(_extreme, "pixel > median", "hdc.encode", name=f"balance {_name}")(
        partial(balance, _pixels, _dtype)
    )


# Distances ----------------------------------------------------------------------------------------


@hypervector_case(
    "D = 1, 63, 64, 65, 127, 250,000: a complement also sets bits beyond the last pixel",
    "~majority(words, ties to zero)", "hdc.bits.majority(words, 'one')",
)  # fmt: skip
def tail_bits() -> Any:
    sizes = (1, 63, 64, 65, 127, D)
    pairs = [bits.pack(torch.cat((mask, ~mask))) for mask in (random_bits(1, d) for d in sizes)]
    # Every bit is tied, so that every bit of the prototype is one: as many as D.
    return (
        lambda: [int(bits.count_ones(~bits.majority(pair, "zero")[None])) for pair in pairs],
        lambda: [int(bits.count_ones(bits.majority(pair, "one")[None])) for pair in pairs],
        sizes,
    )


@hypervector_case(
    "opposite hypervectors: sums of bits kept in bytes wrap at 256",
    "numpy.bitwise_count, summed in uint8", "hdc.bits.hamming",
)  # fmt: skip
def distances_above_255(d: int = D) -> Any:
    mask = random_bits(1, d)
    a, b = bits.pack(mask), bits.pack(~mask)
    return (
        lambda: np.bitwise_count((a ^ b).numpy().view(np.uint64)).sum(dtype=np.uint8),
        lambda: bits.hamming(a, b),
        d,
    )


@hypervector_case(
    "50 of 51 prototypes equally near to every query: the lowest index is expected",
    "topk(1, largest=False)", "HDCClassifier.predict", "queries", error=differing,
)  # fmt: skip
def hamming_ties(d: int = 1024) -> Any:
    frames = torch.from_numpy(random().integers(0, 256, (2, d), dtype=np.uint8))
    model = HDCClassifier().fit(frames[[0] + [1] * 50], np.arange(51))
    queries = frames[1:].repeat(20, 1)
    distances = torch.from_numpy(model.distances(queries))
    return (
        lambda: distances.topk(1, largest=False).indices[:, 0],
        lambda: model.predict(queries),
        1,
    )


# Majority and counters ----------------------------------------------------------------------------


def majority_ties(n: int, n_test: int = 400, d: int = 1000) -> Any:
    """Test errors of both tie rules on the same noisy frames, n training frames a class."""
    patterns, labels = random().normal(size=(5, d)), np.repeat(np.arange(5), n + n_test)
    grey = 128 + 40 * (0.2 * patterns[labels] + random(1).normal(size=(len(labels), d)))
    frames = torch.from_numpy(grey.clip(0, 255).astype(np.uint8))
    train = np.tile(np.arange(n + n_test) < n, 5)

    def wrong(rule: str) -> np.ndarray:
        model = HDCClassifier(ties=rule).fit(frames[train], labels[train])
        return model.predict(frames[~train]) != labels[~train]

    zero, extra = wrong("zero"), wrong("random")
    paired = np.sqrt(np.sum(zero != extra)) / len(zero)
    return extra.mean, zero.mean, 0, float(extra.mean() + 2 * paired)


for _n, _share in ((2, "half"), (4, "3/8"), (10, "1/4")):
    hypervector_case(
        f"{_n} samples a class: {_share} of independent bits are tied. Tolerance: the "
        "other rule's error and two standard errors of the difference",
        "an extra random vector a class", "ties to zero (default)", "test error",
        name=f"majority ties of {_n}",
    )(partial(majority_ties, _n))  # fmt: skip


@hypervector_case(
    "70,000 samples in a class: 16-bit counters wrap at 2^16",
    "uint16 counters", "hdc.prototypes.Counters", "counts",
)  # fmt: skip
def counters_above_2_to_the_16(n: int = 70_000, d: int = 1000) -> Any:
    ones = [round(n * share) for share in np.linspace(0, 1, d)]  # how often each bit is set
    mask = torch.from_numpy(np.arange(n)[:, None] < np.array(ones))
    words = bits.pack(mask)
    return (
        lambda: mask.numpy().sum(0, dtype=np.uint16),
        lambda: counted(words, d).counts()[0],
        ones,
    )


@hypervector_case(
    "2^24 samples merged, then one more: a float32 counter stops at 2^24",
    "float32 counters", "Counters.merge", "counts",
)  # fmt: skip
def counters_above_2_to_the_24() -> Any:
    single = torch.tensor([[-1]])  # all 64 bits

    def ours() -> int:
        total = counted(single, 64)
        for _ in range(24):
            copy = Counters(1, 64)
            copy.merge(total)
            total.merge(copy)
        total.merge(counted(single, 64))
        return int(total.counts()[0, 63])

    def floats() -> float:
        total = torch.ones(1)
        for _ in range(24):
            total += total
        return float(total + 1)

    return floats, ours, 2**24 + 1


@hypervector_case(
    "classes of 1, 2 and 997 samples: one threshold for all empties the small ones",
    "count > N / (2 L)", "Counters.majority", error=differing,
)  # fmt: skip
def unequal_classes(d: int = 10_000) -> Any:
    sizes = torch.tensor([1, 2, 997])
    labels, mask = torch.repeat_interleave(torch.arange(3), sizes), random_bits(1000, d)
    words, counts = bits.pack(mask), torch.stack([mask[labels == c].sum(0) for c in range(3)])
    return (
        lambda: counts > len(labels) / 6,
        lambda: bits.unpack(counted(words, d, labels, 3).majority(), d),
        2 * counts > sizes[:, None],
    )


@hypervector_case(
    "five shards of 1 to 9 samples, merged in all 120 orders: a majority of majorities "
    "depends on the shards",
    "majority of the shards' majorities", "Counters.merge", error=differing,
)  # fmt: skip
def merging_in_any_order(d: int = 10_000) -> Any:
    mask = random_bits(25, d)
    shards = [bits.pack(part) for part in mask.split((1, 3, 5, 7, 9))]

    def ours() -> Tensor:
        prototypes = []
        for order in itertools.permutations([counted(shard, d) for shard in shards]):
            total = Counters(1, d)
            for part in order:
                total.merge(part)
            prototypes.append(total.majority()[0])
        return bits.unpack(torch.stack(prototypes), d)

    return (
        lambda: bits.unpack(bits.majority(torch.stack([*map(bits.majority, shards)])), d),
        ours,
        2 * mask.sum(0) > len(mask),
    )
