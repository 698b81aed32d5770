"""Majority and counters of packed hypervectors; the reference is integers."""

from __future__ import annotations

import itertools
from functools import cache, partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.stability.case import Trial, case
from experiments.studies.stability.cases.hypervectors import random_bits
from hdc import HDCClassifier, bits
from hdc.prototypes import Counters
from scenes.sensor.camera import Camera
from scenes.sensor.contact import Press
from scenes.sensor.scene import SpeckleScene
from scenes.sensor.sensor import Sensor

hypervector_case = partial(case, "hypervectors")


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


@cache
def touches(seed: int, side: int) -> tuple[Tensor, np.ndarray]:
    """Frames [L, 100, side, side] and labels [L, 100] of the scene touch, seen by fewer pixels."""
    made = touch(seed, grid=side, crop=side, pupil=side * 2 // 5)
    order = np.argsort(made.labels, kind="stable").reshape(len(made.classes), -1)
    return made.frames(order.ravel()).unflatten(0, order.shape), made.labels[order]


def touch(seed: int, **camera: int) -> SpeckleScene:
    """The scene of configs/scene/touch.yaml at a seed, with another camera."""
    places = {
        "L1": (28e-3, -8e-3),
        "L2": (28e-3, 8e-3),
        "R1": (52e-3, -8e-3),
        "R2": (52e-3, 8e-3),
    }
    classes = {name: {"position": place} for name, place in places.items()} | {"None": None}
    press = partial(Press, radius=2.45e-3, depth=1.8e-3, depth_spread=0.01, position_spread=2e-5)
    return SpeckleScene(Sensor(seed, camera=Camera(**camera)), classes, press, seed=seed)


TIES: dict[str, Any] = {
    "expected": "no loss: error at most that of the extra random vector and two standard errors",
    "reference": "labels of the same test frames",
    "unit": "test error",
    "naive": "an extra random vector a class",
    "ours": "ties to zero (default)",
    "small": {"seeds": 1, "side": 64},
}


@hypervector_case(extreme="2 samples a class: half of the prototype's bits are tied", **TIES)
def majority_ties_of_2(seeds: int = 4, side: int = 128) -> Trial:
    return ties(2, seeds, side)


@hypervector_case(extreme="4 samples a class: 3/8 of independent bits are tied", **TIES)
def majority_ties_of_4(seeds: int = 4, side: int = 128) -> Trial:
    return ties(4, seeds, side)


@hypervector_case(extreme="10 samples a class: 1/4 of independent bits are tied", **TIES)
def majority_ties_of_10(seeds: int = 4, side: int = 128) -> Trial:
    return ties(10, seeds, side)


# Counters -----------------------------------------------------------------------------------------

COUNTS: dict[str, Any] = {"reference": "Python integers", "unit": "counts"}


@hypervector_case(
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


@hypervector_case(
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


@hypervector_case(
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
    mask = random_bits(sum(sizes), d)
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


@hypervector_case(
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
    mask = random_bits(sum(sizes), d)
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
