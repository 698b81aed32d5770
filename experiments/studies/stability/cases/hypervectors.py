"""Packed hypervectors: balance, distances, majority and counters; the reference is integers."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from torch import Tensor

from experiments.studies.stability.case import Forms, case
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters

D = 250_000  # pixels of a frame in the paper
hypervector_case = partial(case, "hypervectors")


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def random_bits(n: int, d: int) -> Tensor:
    """Random bits, bool [n, d]."""
    return torch.from_numpy(random().integers(0, 2, (n, d), dtype=np.uint8).view(bool))


# Balance ------------------------------------------------------------------------------------------


def dark(d: int) -> np.ndarray:
    """70 % of the pixels are zero."""
    pixels = np.zeros(d)
    pixels[: 3 * d // 10] = random().integers(1, 9, 3 * d // 10)
    return random().permutation(pixels)


FRAMES: dict[str, tuple[str, Callable[[int], np.ndarray], str]] = {
    "with ties at the median": (
        "8-bit speckle: some 3,000 of 250,000 pixels equal the median",
        lambda d: random().gamma(2, 25, d).round().clip(0, 255),  # two polarisations, mean 50
        "uint8",
    ),
    "of a constant frame": ("every pixel is 128", lambda d: np.full(d, 128), "uint8"),
    "of a saturated frame": (
        "overexposed: more than 60 % of the pixels are 255",
        lambda d: np.where(np.arange(d) < 6 * d // 10, 255, random().gamma(2, 255, d).clip(0, 255)),
        "uint8",
    ),
    "of a dark frame": ("underexposed: 70 % of the pixels are 0", dark, "uint8"),
    "of a two-valued frame": (
        "two values only, 0 and 255, 40 % of them 255",
        lambda d: (random().random(d) < 0.4) * 255,
        "uint8",
    ),
    "of signed pixels": (
        "int16 from -3 to 3, as after a dark frame was subtracted: a seventh equals the median",
        lambda d: random().integers(-3, 4, d),
        "int16",
    ),
    "of subnormal pixels": (
        "float32 of 1 to 9 times 1.4·10^-45, the smallest number there is",
        lambda d: random().integers(1, 10, d) * 2.0**-149,
        "float32",
    ),
    "of signed zeros": (
        "float32 zeros, half of them negative: equal, though their bits differ",
        lambda d: np.where(np.arange(d) % 2, -0.0, 0.0),
        "float32",
    ),
}


def balance(pixels: Callable[[int], np.ndarray], dtype: str, d: int = D) -> Forms:
    """Ones of a frame's hypervector against ⌊D/2⌋."""
    frame = torch.from_numpy(pixels(d).astype(dtype))
    return Forms(
        lambda: int((frame > frame.median()).sum()),
        lambda: int(bits.count_ones(encode(frame[None]))),
        lambda ones: abs(ones - d // 2),
    )


for _name, (_extreme, _pixels, _dtype) in FRAMES.items():
    hypervector_case(
        name=f"balance {_name}",
        extreme=_extreme,
        naive="pixel > median",
        ours="hdc.encode",
        unit="bits",
        small={"d": 2000},
    )(partial(balance, _pixels, _dtype))


@hypervector_case(
    extreme="16-bit, half of the pixels above 32,767: a cast to int16 makes them negative",
    naive="int16 pixels > their median",
    ours="hdc.encode",
    unit="bits",
    small={"d": 2000},
)
def sixteen_bit_pixels(d: int = D) -> Forms:
    grey = random().integers(0, 65_536, d)
    # Of equal pixels the first in raster order are ones.
    brightest = sorted(range(d), key=lambda i: (-int(grey[i]), i))[: d // 2]
    exact = torch.zeros(d, dtype=torch.bool)
    exact[brightest] = True
    frame = torch.from_numpy(grey.astype(np.uint16))
    signed = frame.view(torch.int16)
    return Forms(
        lambda: signed > signed.median(),
        lambda: bits.unpack(encode(frame[None])[0], d),
        lambda ones: int((ones != exact).sum()),
    )


# Distances ----------------------------------------------------------------------------------------


@hypervector_case(
    extreme="D = 1, 63, 64, 65, 127, 250,000: a complement also sets bits beyond the last pixel",
    naive="~majority(words, ties to zero)",
    ours="hdc.bits.majority(words, 'one')",
    unit="bits",
)
def tail_bits() -> Forms:
    sizes = (1, 63, 64, 65, 127, D)
    pairs = []
    for d in sizes:
        mask = random_bits(1, d)
        pairs.append(bits.pack(torch.cat((mask, ~mask))))

    # Every bit is tied, so that every bit of the prototype is one and its distance from zero is D.
    def distances(prototypes: list[Tensor]) -> list[int]:
        return [int(bits.hamming(p[None], torch.zeros_like(p)[None])) for p in prototypes]

    return Forms(
        lambda: distances([~bits.majority(pair, "zero") for pair in pairs]),
        lambda: distances([bits.majority(pair, "one") for pair in pairs]),
        lambda ones: max(abs(x - d) for x, d in zip(ones, sizes, strict=True)),
    )


@hypervector_case(
    extreme="D = 10^8 + 1: float32 has no integers above 2^24, and one bit lies in the tail",
    naive="float32 product of ±1",
    ours="hdc.encode, hdc.bits.hamming",
    unit="bits",
    small={"d": 2**17 + 1},
)
def a_hundred_million_pixels(d: int = 10**8 + 1) -> Forms:
    ramp = np.resize(np.arange(251, dtype=np.uint8), d)
    frames = torch.from_numpy(ramp)[None], torch.from_numpy(ramp[::-1].copy())[None]
    ones = [bits.unpack(encode(frame)[0], d).numpy() for frame in frames]
    exact = int(np.count_nonzero(ones[0] != ones[1]))

    def floats() -> float:
        total = torch.zeros(())
        for start in range(0, d, 2**24):  # ±1 for all pixels at once would take 800 MB
            a, b = (torch.from_numpy(o[start : start + 2**24]).float() * 2 - 1 for o in ones)
            total += a @ b
        return (d - float(total)) / 2

    return Forms(
        floats,
        lambda: int(bits.hamming(encode(frames[0]), encode(frames[1]))),
        lambda distance: abs(distance - exact),
    )


@hypervector_case(
    extreme="opposite hypervectors: sums of bits kept in bytes wrap at 256",
    naive="numpy.bitwise_count, summed in uint8",
    ours="hdc.bits.hamming",
    unit="bits",
)
def distances_above_255(d: int = D) -> Forms:
    mask = random_bits(1, d)
    a, b = bits.pack(mask), bits.pack(~mask)
    return Forms(
        lambda: int(np.bitwise_count((a ^ b).numpy().view(np.uint64)).sum(dtype=np.uint8)),
        lambda: int(bits.hamming(a, b)),
        lambda distance: abs(distance - d),
    )


@hypervector_case(
    extreme="50 of 51 prototypes equally near to every query: the lowest index is expected",
    naive="topk(1, largest=False)",
    ours="HDCClassifier.predict",
    unit="queries",
)
def hamming_ties(d: int = 1024) -> Forms:
    frames = torch.from_numpy(random().integers(0, 256, (2, d), dtype=np.uint8))
    model = HDCClassifier().fit(frames[[0] + [1] * 50], np.arange(51))
    queries = frames[1:].repeat(20, 1)
    distances = torch.from_numpy(model.distances(queries))
    return Forms(
        lambda: distances.topk(1, largest=False).indices[:, 0].numpy(),
        lambda: model.predict(queries),
        lambda predicted: int((predicted != 1).sum()),
    )


@hypervector_case(
    extreme="words whose bit 63 is set: numpy counts the bits of a signed integer's magnitude",
    naive="numpy.bitwise_count of int64",
    ours="hdc.bits.popcount",
    unit="bits",
)
def negative_words() -> Forms:
    words = torch.tensor([-1, -2, -(2**63), 2**63 - 1, -(2**40)])
    exact = [(w & (2**64 - 1)).bit_count() for w in words.tolist()]
    return Forms(
        lambda: np.bitwise_count(words.numpy()),
        lambda: bits.popcount(words).numpy(),
        lambda counts: int(np.abs(counts.astype(int) - exact).max()),
    )


# Majority and counters ----------------------------------------------------------------------------


def majority_ties(n: int, n_test: int = 400, d: int = 1000) -> Forms:
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
    return Forms(
        lambda: wrong("random"),
        lambda: wrong("zero"),
        lambda errors: float(np.mean(errors)),
        float(extra.mean() + 2 * paired),
    )


for _n, _share in ((2, "half"), (4, "3/8"), (10, "1/4")):
    hypervector_case(
        name=f"majority ties of {_n}",
        extreme=f"{_n} samples a class: {_share} of independent bits are tied. Tolerance: the "
        "other rule's error and two standard errors of the difference",
        naive="an extra random vector a class",
        ours="ties to zero (default)",
        unit="test error",
    )(partial(majority_ties, _n))


@hypervector_case(
    extreme="70,000 samples in a class: 16-bit counters wrap at 2^16",
    naive="uint16 counters",
    ours="hdc.prototypes.Counters",
    unit="counts",
)
def counters_above_2_to_the_16(n: int = 70_000, d: int = 1000) -> Forms:
    ones = [round(n * share) for share in np.linspace(0, 1, d)]  # how often each bit is set
    mask = torch.from_numpy(np.arange(n)[:, None] < np.array(ones))
    words = bits.pack(mask)

    def counted() -> np.ndarray:
        counters = Counters(1, d)
        counters.add(words, torch.zeros(n, dtype=torch.int64))
        return counters.counts()[0].numpy()

    return Forms(
        lambda: mask.numpy().sum(0, dtype=np.uint16),
        counted,
        lambda counts: np.abs(counts.astype(np.int64) - ones).max(),
    )


@hypervector_case(
    extreme="2^24 samples merged, then one more: a float32 counter stops at 2^24",
    naive="float32 counters",
    ours="Counters.merge",
    unit="counts",
)
def counters_above_2_to_the_24(doublings: int = 24) -> Forms:
    def counted() -> int:
        total, single = Counters(1, 64), Counters(1, 64)
        single.add(torch.tensor([[-1]]), torch.tensor([0]))  # all 64 bits
        total.merge(single)
        for _ in range(doublings):
            copy = Counters(1, 64)
            copy.merge(total)
            total.merge(copy)
        total.merge(single)
        return int(total.counts()[0, 63])

    def floats() -> int:
        total = torch.ones(64)
        for _ in range(doublings):
            total += total
        return int((total + 1)[63])

    return Forms(floats, counted, lambda count: abs(count - 2**doublings - 1))


@hypervector_case(
    extreme="classes of 1, 2 and 997 samples: one threshold for all empties the small ones",
    naive="count > N / (2 L)",
    ours="Counters.majority",
    unit="bits",
)
def unequal_classes(d: int = 10_000) -> Forms:
    sizes = torch.tensor([1, 2, 997])
    labels, mask = torch.repeat_interleave(torch.arange(3), sizes), random_bits(1000, d)
    words, counts = bits.pack(mask), torch.stack([mask[labels == c].sum(0) for c in range(3)])

    def ours() -> Tensor:
        counters = Counters(3, d)
        counters.add(words, labels)
        return bits.unpack(counters.majority(), d)

    return Forms(
        lambda: counts > len(labels) / 6,
        ours,
        lambda prototypes: int((prototypes != (2 * counts > sizes[:, None])).sum()),
    )


@hypervector_case(
    extreme="five shards of 1 to 9 samples, merged in all 120 orders: a majority of majorities "
    "depends on the shards",
    naive="majority of the shards' majorities",
    ours="Counters.merge",
    unit="bits",
    small={"d": 640},
)
def merging_in_any_order(d: int = 10_000) -> Forms:
    mask = random_bits(25, d)
    exact = 2 * mask.sum(0) > len(mask)
    shards = [bits.pack(part) for part in mask.split((1, 3, 5, 7, 9))]

    def ours() -> Tensor:
        parts = [Counters(1, d) for _ in shards]
        for part, shard in zip(parts, shards, strict=True):
            part.add(shard, torch.zeros(len(shard), dtype=torch.int64))
        prototypes = []
        for order in itertools.permutations(parts):
            total = Counters(1, d)
            for part in order:
                total.merge(part)
            prototypes.append(total.majority()[0])
        return bits.unpack(torch.stack(prototypes), d)

    return Forms(
        lambda: bits.unpack(bits.majority(torch.stack([*map(bits.majority, shards)])), d),
        ours,
        lambda prototypes: int((prototypes != exact).sum()),
    )
