"""Balance and distances of packed hypervectors; the reference is integers."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.stability.case import Trial, case
from hdc import HDCClassifier, bits
from hdc.encode import encode

hypervector_case = partial(case, "hypervectors")

D = 250_000  # pixels of a frame in the paper
BALANCE: dict[str, Any] = {
    "expected": "exactly ⌊D/2⌋ ones; a comparison leaves the pixels that equal the median zero",
    "reference": "⌊D/2⌋",
    "unit": "bits",
    "naive": "pixel > median",
    "ours": "hdc.encode",
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


def random_bits(n: int, d: int, seed: int = 0) -> Tensor:
    """Random bits, bool [n, d]."""
    return torch.from_numpy(random(seed).integers(0, 2, (n, d), dtype=np.uint8).view(bool))


@hypervector_case(extreme="8-bit speckle: some 3,000 of 250,000 pixels equal the median", **BALANCE)
def balance_with_ties_at_the_median(d: int = D) -> Trial:
    grey = random().gamma(2, 25, d).round().clip(0, 255)  # two polarisations, mean 50
    return balance(torch.from_numpy(grey.astype(np.uint8)))


@hypervector_case(extreme="constant frame: every pixel is 128", **BALANCE)
def balance_of_a_constant_frame(d: int = D) -> Trial:
    return balance(torch.full((d,), 128, dtype=torch.uint8))


@hypervector_case(extreme="overexposed: 60 % of the pixels are 255", **BALANCE)
def balance_of_a_saturated_frame(d: int = D) -> Trial:
    grey = random().gamma(2, 255, d).clip(0, 255)
    grey[: 6 * d // 10] = 255
    return balance(torch.from_numpy(grey.astype(np.uint8)))


@hypervector_case(extreme="underexposed: 70 % of the pixels are 0", **BALANCE)
def balance_of_a_dark_frame(d: int = D) -> Trial:
    grey = np.zeros(d, np.uint8)
    grey[: 3 * d // 10] = random().integers(1, 9, 3 * d // 10)
    return balance(torch.from_numpy(random().permutation(grey)))


@hypervector_case(extreme="two values only, 0 and 255, 40 % of them 255", **BALANCE)
def balance_of_a_two_valued_frame(d: int = D) -> Trial:
    return balance(torch.from_numpy((random().random(d) < 0.4).astype(np.uint8) * 255))


@hypervector_case(
    extreme="16-bit frame with half of its pixels above 32,767",
    expected="the bits of the exact order; a cast to int16 makes bright pixels negative",
    reference="stable sort of the pixels as Python integers",
    unit="bits",
    naive="int16 pixels > their median",
    ours="hdc.encode",
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


# Distances ----------------------------------------------------------------------------------------


@hypervector_case(
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
        mask = random_bits(1, d)
        pairs.append(bits.pack(torch.cat((mask, ~mask))))

    # Every bit is tied, so that every bit of the prototype is one and its distance from zero is D.
    def distances(prototypes: list[Tensor]) -> list[int]:
        return [int(bits.hamming(p[None], torch.zeros_like(p)[None])) for p in prototypes]

    return Trial(
        naive=lambda: distances([~bits.majority(pair, "zero") for pair in pairs]),
        ours=lambda: distances([bits.majority(pair, "one") for pair in pairs]),
        error=lambda found: max(abs(x - d) for x, d in zip(found, sizes, strict=True)),
    )


@hypervector_case(
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


@hypervector_case(
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


@hypervector_case(
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
