"""Distances, majority and counters at the sizes where counting goes wrong; references are whole
numbers."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.limits.stability.case import case, differing
from hdc import HDCClassifier, bits
from hdc.prototypes import Counters

D = 250_000  # pixels of a frame in the paper


def random_bits(n: int, d: int) -> Tensor:
    """Random bits, bool [n, d]."""
    drawn = np.random.default_rng(0).random((n, d)) < 0.5
    return torch.from_numpy(drawn)


counting_case = partial(case, "counting")


def counted(
    words: Tensor,
    d: int,
    labels: Tensor,
) -> Counters:
    """Counters of these hypervectors."""
    counters = Counters(int(labels.max()) + 1, d)
    counters.add(words, labels)
    return counters


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


for _d in (1, 63, 65, D):
    counting_case(
        f"D = {_d:,}: a complement also sets bits beyond the last pixel",
        "~majority(words, ties to zero)",
        "hdc.bits.majority(words, 'one')",
        "bits",
        name=f"tail bits of {_d:,} pixels",
    )(partial(tail_bits, _d))


@counting_case(
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


def ties(readout: str, d: int = 1024) -> Any:
    """Labels of 20 queries that are as near to 50 classes of 51."""
    drawn = np.random.default_rng(0).integers(0, 256, (2, d), dtype=np.uint8)
    model = HDCClassifier(readout=readout)
    model.fit(drawn[[0] + [1] * 50], np.arange(51))
    queries = drawn[[1] * 20]
    scores = torch.from_numpy(model.decision_function(queries))

    def naive() -> Tensor:
        largest = scores.topk(1)
        return largest.indices[:, 0]

    return naive, partial(model.predict, queries), 1


for _readout in ("majority", "counts", "neighbours"):
    counting_case(
        "50 of 51 classes equally near to every query: the lowest index is expected",
        "topk(1)", f"HDCClassifier(readout={_readout!r})", "queries",
        name=f"ties of {_readout}", error=differing,
    )(partial(ties, _readout))  # fmt: skip


@counting_case(
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


@counting_case(
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
