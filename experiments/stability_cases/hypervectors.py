"""Balance, majority, counters and distances of packed hypervectors; the reference is integers."""

from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.stability_cases.case import REFUSAL, Trial, case, refusal
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters
from scenes.sensor.configured import scene

D = 250_000  # pixels of a frame in the paper
MEDIAN = "pixel > median"
ENCODE = "hdc.encode"
BALANCE: dict[str, Any] = {
    "expected": "exactly ⌊D/2⌋ ones; a comparison leaves the pixels that equal the median zero",
    "reference": "⌊D/2⌋",
    "unit": "bits",
    "naive": MEDIAN,
    "ours": ENCODE,
    "small": {"d": 2000},
}


def balance(frame: Tensor) -> Trial:
    """Ones of a frame's hypervector beside ⌊D/2⌋."""
    half = frame.numel() // 2
    return Trial(
        naive=lambda: int((frame > frame.median()).sum()),
        ours=lambda: int(bits.count_ones(encode(frame[None]))),
        error=lambda ones: abs(ones - half),
    )


def random(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def hypervectors(n: int, d: int, seed: int = 0) -> Tensor:
    """Random bits, bool [n, d]."""
    return torch.from_numpy(random(seed).integers(0, 2, (n, d), dtype=np.uint8).view(bool))


@case(extreme="8-bit speckle: some 3,000 of 250,000 pixels equal the median", **BALANCE)
def balance_with_ties_at_the_median(d: int = D) -> Trial:
    grey = random().gamma(2, 25, d).round().clip(0, 255)  # two polarisations, mean 50
    return balance(torch.from_numpy(grey.astype(np.uint8)))


@case(extreme="constant frame: every pixel is 128", **BALANCE)
def balance_of_a_constant_frame(d: int = D) -> Trial:
    return balance(torch.full((d,), 128, dtype=torch.uint8))


@case(extreme="overexposed: 60 % of the pixels are 255", **BALANCE)
def balance_of_a_saturated_frame(d: int = D) -> Trial:
    grey = random().gamma(2, 255, d).clip(0, 255)
    grey[: 6 * d // 10] = 255
    return balance(torch.from_numpy(grey.astype(np.uint8)))


@case(extreme="underexposed: 70 % of the pixels are 0", **BALANCE)
def balance_of_a_dark_frame(d: int = D) -> Trial:
    grey = np.zeros(d, np.uint8)
    grey[: 3 * d // 10] = random().integers(1, 9, 3 * d // 10)
    return balance(torch.from_numpy(random().permutation(grey)))


@case(extreme="two values only, 0 and 255, 40 % of them 255", **BALANCE)
def balance_of_a_two_valued_frame(d: int = D) -> Trial:
    return balance(torch.from_numpy((random().random(d) < 0.4).astype(np.uint8) * 255))


@case(
    extreme="16-bit frame with half of its pixels above 32,767",
    expected="the bits of the exact order; a cast to int16 makes bright pixels negative",
    reference="stable sort of the pixels as Python integers",
    unit="bits",
    naive="int16 pixels > their median",
    ours=ENCODE,
    small={"d": 2000},
)
def sixteen_bit_pixels(d: int = D) -> Trial:
    grey = random().integers(0, 65_536, d)
    # Of equal pixels the first in raster order are ones.
    brightest = sorted(range(d), key=lambda i: (-int(grey[i]), i))[: d // 2]
    exact = torch.zeros(d, dtype=torch.bool)
    exact[brightest] = True
    frame = torch.from_numpy(grey.astype(np.uint16))
    signed = frame.view(torch.int16)
    return Trial(
        naive=lambda: signed > signed.median(),
        ours=lambda: bits.unpack(encode(frame[None])[0], d),
        error=lambda ones: int((ones != exact).sum()),
    )


@case(
    extreme="one of five frames is constant: it carries no information",
    expected="one warning that names frame 3; a comparison with the median says nothing",
    reference="one warning with the index 3",
    unit="frames not named",
    naive=MEDIAN,
    ours=ENCODE,
    small={"d": 2000},
)
def a_constant_frame_is_named(d: int = D) -> Trial:
    frames = torch.from_numpy(random().integers(0, 256, (5, d), dtype=np.uint8))
    frames[3] = 7

    def said(form: Callable[[], Any]) -> list[str]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            form()
        return [str(warning.message) for warning in caught]

    return Trial(
        naive=lambda: said(lambda: frames > frames.median(1, keepdim=True).values),
        ours=lambda: said(lambda: encode(frames)),
        error=lambda messages: not (len(messages) == 1 and "index 3:" in messages[0]),
    )


@case(
    extreme="one pixel in five frames is NaN",
    expected="a ValueError that names frame 3; NaN > median is false in silence",
    reference="a named error",
    unit=REFUSAL,
    naive=MEDIAN,
    ours=ENCODE,
    small={"d": 2000},
)
def a_pixel_that_is_not_a_number(d: int = D) -> Trial:
    frames = torch.from_numpy(random().random((5, d)))
    frames[3, 17] = torch.nan
    return Trial(
        naive=lambda: frames > frames.nanmedian(1, keepdim=True).values,
        ours=lambda: encode(frames),
        error=refusal("frames[3]", "nan"),
    )


# Majority -----------------------------------------------------------------------------------------


def ties(n: int, seeds: int, side: int) -> Trial:
    """Test errors of both tie rules on the same simulated touches, n training samples a class."""
    data = [touches(seed, side) for seed in range(seeds)]

    def wrong(rule: str) -> np.ndarray:
        found = []
        for frames, labels in data:  # [L, 100, H, W], of which the first n train
            model = HDCClassifier(ties=rule).fit(frames[:, :n].flatten(0, 1), labels[:, :n].ravel())
            found.append(model.predict(frames[:, n:].flatten(0, 1)) != labels[:, n:].ravel())
        return np.concatenate(found)

    zero, extra = wrong("zero"), wrong("random")
    paired = np.sqrt(np.sum(zero != extra)) / len(zero)
    return Trial(
        naive=lambda: wrong("random"),
        ours=lambda: wrong("zero"),
        error=lambda missed: float(np.mean(missed)),
        tolerance=float(extra.mean() + 2 * paired),
        remark=lambda: (
            f"accuracy {1 - zero.mean():.2%} with ties to zero, {1 - extra.mean():.2%} with an "
            f"extra random vector, {len(zero)} simulated test frames"
        ),
    )


@functools.cache
def touches(seed: int, side: int) -> tuple[Tensor, np.ndarray]:
    """Frames [L, 100, side, side] and labels [L, 100] of the scene touch, seen by fewer pixels."""
    camera = {"grid": side, "crop": side, "pupil": side * 2 // 5}
    overrides = [f"sensor.camera.{key}={value}" for key, value in camera.items()]
    made = scene("touch", seed, seed, overrides)
    order = np.argsort(made.labels, kind="stable").reshape(len(made.classes), -1)
    return made.frames(order.ravel()).unflatten(0, order.shape), made.labels[order]


TIES: dict[str, Any] = {
    "expected": "no loss: error at most that of the extra random vector and two standard errors",
    "reference": "labels of the same test frames",
    "unit": "test error",
    "naive": "an extra random vector a class",
    "ours": "ties to zero (default)",
    "small": {"seeds": 1, "side": 64},
}


@case(extreme="2 samples a class: half of the prototype's bits are tied", **TIES)
def majority_ties_of_2(seeds: int = 4, side: int = 128) -> Trial:
    return ties(2, seeds, side)


@case(extreme="4 samples a class: 3/8 of independent bits are tied", **TIES)
def majority_ties_of_4(seeds: int = 4, side: int = 128) -> Trial:
    return ties(4, seeds, side)


@case(extreme="10 samples a class: 1/4 of independent bits are tied", **TIES)
def majority_ties_of_10(seeds: int = 4, side: int = 128) -> Trial:
    return ties(10, seeds, side)


# Counters -----------------------------------------------------------------------------------------

COUNTS: dict[str, Any] = {"reference": "Python integers", "unit": "counts"}


@case(
    extreme="70,000 samples in a class, above 2^16",
    expected="exact counts; 16-bit counters wrap",
    naive="uint16 counters",
    ours="hdc.prototypes.Counters",
    **COUNTS,
)
def counters_above_2_to_the_16(n: int = 70_000, d: int = 1000) -> Trial:
    shares = np.linspace(0, 1, d)  # how often each bit is set, from never to always
    ones = [round(n * share) for share in shares]
    mask = torch.from_numpy(np.arange(n)[:, None] < np.array(ones))
    words = bits.pack(mask)

    def counted() -> Tensor:
        counters = Counters(1, d)
        counters.add(words, torch.zeros(n, dtype=torch.int64))
        return counters.counts()[0]

    return Trial(
        naive=lambda: mask.numpy().sum(0, dtype=np.uint16),
        ours=counted,
        error=lambda counts: max(
            abs(int(c) - k) for c, k in zip(counts.tolist(), ones, strict=True)
        ),
    )


@case(
    extreme="2^24 samples merged, then one more",
    expected="2^24 + 1; a float32 counter stands still at 2^24",
    naive="float32 counters",
    ours="Counters.merge",
    **COUNTS,
)
def counters_above_2_to_the_24(doublings: int = 24) -> Trial:
    def counted() -> int:
        counters = Counters(1, 64)
        counters.add(torch.tensor([[-1]]), torch.tensor([0]))  # all 64 bits
        one, total = Counters(1, 64), counters
        one.merge(counters)
        for _ in range(doublings):
            again = Counters(1, 64)
            again.merge(total)
            total.merge(again)
        total.merge(one)
        return int(total.counts()[0, 63])

    def floats() -> int:
        total = torch.ones(64)
        for _ in range(doublings):
            total += total
        return int((total + 1)[63])

    return Trial(naive=floats, ours=counted, error=lambda count: abs(count - 2**doublings - 1))


@case(
    extreme="classes of 1, 2 and 997 samples",
    expected="each class by its own number; one threshold for all classes empties the small ones",
    reference="2·count > n in Python integers",
    unit="bits",
    naive="count > N / (2 L)",
    ours="Counters.majority",
)
def unequal_classes(d: int = 10_000) -> Trial:
    sizes = (1, 2, 997)
    labels = torch.repeat_interleave(torch.arange(3), torch.tensor(sizes))
    mask = hypervectors(sum(sizes), d)
    words = bits.pack(mask)
    counts = torch.stack([mask[labels == c].sum(0) for c in range(3)])
    exact = torch.stack([2 * count > n for count, n in zip(counts, sizes, strict=True)])

    def ours() -> Tensor:
        counters = Counters(3, d)
        counters.add(words, labels)
        return bits.unpack(counters.majority(), d)

    return Trial(
        naive=lambda: counts > len(labels) / 6,
        ours=ours,
        error=lambda prototypes: int((prototypes != exact).sum()),
    )


@case(
    extreme="a class without samples",
    expected="a ValueError that names class 1; a comparison makes a prototype of zeros in silence",
    reference="a named error",
    unit=REFUSAL,
    naive="count > n / 2",
    ours="Counters.majority",
)
def an_empty_class(d: int = 10_000) -> Trial:
    counters = Counters(2, d)
    counters.add(bits.pack(hypervectors(3, d)), torch.zeros(3, dtype=torch.int64))
    return Trial(
        naive=lambda: counters.counts() > counters.n[:, None] / 2,
        ours=counters.majority,
        error=refusal("class 1"),
    )


@case(
    extreme="five shards of 1 to 9 samples, merged in all 120 orders",
    expected="the bits of one count of all samples; a majority of majorities depends on the shards",
    reference="2·count > n of all samples in integers",
    unit="bits",
    naive="majority of the shards' majorities",
    ours="Counters.merge",
    small={"d": 640},
)
def merging_in_any_order(d: int = 10_000) -> Trial:
    sizes = (1, 3, 5, 7, 9)
    mask = hypervectors(sum(sizes), d)
    exact = 2 * mask.sum(0) > len(mask)
    shards = [bits.pack(part) for part in mask.split(sizes)]

    def counted(shard: Tensor) -> Counters:
        counters = Counters(1, d)
        counters.add(shard, torch.zeros(len(shard), dtype=torch.int64))
        return counters

    def ours() -> Tensor:
        parts = [counted(shard) for shard in shards]
        prototypes = []
        for order in itertools.permutations(parts):
            total = Counters(1, d)
            for part in order:
                total.merge(part)
            prototypes.append(total.majority()[0])
        return bits.unpack(torch.stack(prototypes), d)

    return Trial(
        naive=lambda: bits.unpack(bits.majority(torch.stack(list(map(bits.majority, shards)))), d),
        ours=ours,
        error=lambda prototypes: int((prototypes != exact).sum()),
    )


# Distances ----------------------------------------------------------------------------------------


@case(
    extreme="D = 1, 63, 64, 65, 127 and 250,000: the last word is not full",
    expected="two opposite hypervectors, ties to one: D ones; a complement sets the tail as well",
    reference="D",
    unit="bits",
    naive="~majority(words, ties to zero)",
    ours="hdc.bits.majority(words, 'one')",
)
def tail_bits() -> Trial:
    sizes = (1, 63, 64, 65, 127, D)
    pairs = []
    for d in sizes:
        mask = hypervectors(1, d)
        pairs.append(bits.pack(torch.cat((mask, ~mask))))

    # Every bit is tied, so that every bit of the prototype is one and its distance from zero is D.
    def distances(prototypes: list[Tensor]) -> list[int]:
        return [int(bits.hamming(p[None], torch.zeros_like(p)[None])) for p in prototypes]

    return Trial(
        naive=lambda: distances([~bits.majority(pair, "zero") for pair in pairs]),
        ours=lambda: distances([bits.majority(pair, "one") for pair in pairs]),
        error=lambda found: max(abs(x - d) for x, d in zip(found, sizes, strict=True)),
    )


@case(
    extreme="D = 10^8 + 1: more than the 2^24 integers that float32 holds, and one bit in the tail",
    expected="the exact distance of a frame and its mirror image; float32 sums round",
    reference="numpy int64 count of the differing bits",
    unit="bits",
    naive="float32 product of ±1",
    ours="hdc.encode, hdc.bits.hamming",
    small={"d": 2**17 + 1},
)
def a_hundred_million_pixels(d: int = 10**8 + 1) -> Trial:
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

    return Trial(
        naive=floats,
        ours=lambda: int(bits.hamming(encode(frames[0]), encode(frames[1]))),
        error=lambda distance: abs(distance - exact),
    )


@case(
    extreme="50 of 51 prototypes equally near to every query",
    expected="the lowest index among the nearest, as documented",
    reference="first index of the least integer distance",
    unit="queries",
    naive="topk(1, largest=False)",
    ours="HDCClassifier.predict",
)
def hamming_ties(d: int = 1024) -> Trial:
    frames = torch.from_numpy(random().integers(0, 256, (2, d), dtype=np.uint8))
    labels = np.arange(51)
    prototypes = frames[[0] + [1] * 50]  # class 0 differs, 1 to 50 are the same
    queries = frames[1:].repeat(20, 1)
    model = HDCClassifier().fit(prototypes, labels)
    distances = torch.from_numpy(model.distances(queries))
    return Trial(
        naive=lambda: distances.topk(1, largest=False).indices[:, 0].numpy(),
        ours=lambda: model.predict(queries),
        error=lambda predicted: int((predicted != 1).sum()),
    )


@case(
    extreme="words whose bit 63 is set: negative as int64",
    expected="64-bit counts; numpy counts the bits of a signed integer's magnitude",
    reference="Python's int.bit_count",
    unit="bits",
    naive="numpy.bitwise_count of int64",
    ours="hdc.bits.popcount",
)
def negative_words() -> Trial:
    words = torch.tensor([-1, -2, -(2**63), 2**63 - 1, -(2**40)])
    exact = [(w & (2**64 - 1)).bit_count() for w in words.tolist()]
    return Trial(
        naive=lambda: np.bitwise_count(words.numpy()),
        ours=lambda: bits.popcount(words).numpy(),
        error=lambda counts: int(np.abs(counts.astype(int) - exact).max()),
    )
