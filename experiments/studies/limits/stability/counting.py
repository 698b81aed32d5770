"""Distances, majority and counters at the sizes where counting goes wrong; references are whole
numbers."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.limits.stability.case import Case, differing, largest
from hdc import HDCClassifier, bits
from hdc.prototypes import Counters, merged

Array = np.ndarray[Any, Any]
D = 250_000  # pixels of a frame in the paper


def random_bits(n: int, d: int) -> Tensor:
    """Random bits, bool [n, d]."""
    return torch.from_numpy(np.random.default_rng(0).random((n, d)) < 0.5)


def counted(mask: Tensor, labels: Tensor) -> Counters:
    """Counters of hypervectors bool [N, D]."""
    counters = Counters(int(labels.max()) + 1, mask.shape[1])
    counters.add(bits.pack(mask), labels)
    return counters


def distances_above_255() -> Any:
    mask = random_bits(1, D)
    a, b = bits.pack(mask), bits.pack(~mask)
    apart = np.bitwise_count((a ^ b).numpy().view(np.uint64))
    return partial(apart.sum, dtype=np.uint8), partial(bits.hamming, a, b), D


def ties(readout: str, d: int = 1024) -> Any:
    """Labels of 20 queries that are as near to 50 classes of 51."""
    drawn = np.random.default_rng(0).integers(0, 256, (2, d), dtype=np.uint8)
    model = HDCClassifier(readout=readout)
    model.fit(drawn[[0] + [1] * 50], np.arange(51))
    queries = drawn[[1] * 20]
    scores = torch.from_numpy(model.decision_function(queries))
    return lambda: scores.topk(1).indices[:, 0], partial(model.predict, queries), 1


def counters_above_2_to_the_16(n: int = 70_000, d: int = 200) -> Any:
    ones = [round(n * share) for share in np.linspace(0, 1, d)]  # of each bit
    mask = torch.arange(n)[:, None] < torch.tensor(ones)
    labels = torch.zeros(n, dtype=torch.int64)
    naive = partial(mask.numpy().sum, 0, dtype=np.uint16)
    return naive, lambda: counted(mask, labels).counts()[0], ones


def repeated_merges(times: int = 12, d: int = 2000) -> Any:
    """Majorities of votes of which each new hypervector has a tenth; by fractions."""
    mask = random_bits(times + 1, d)
    single = [counted(row[None], torch.tensor([0])) for row in mask]
    shares = np.array([Fraction(int(one)) for one in mask[0]])
    for row in mask[1:]:
        shares = shares * Fraction(9, 10) + row.numpy() * Fraction(1, 10)

    def naive() -> Array:
        votes = mask[0].numpy().astype(np.uint16)
        total = 1
        for row in mask[1:]:
            votes, total = 9 * votes + total * row.numpy().astype(np.uint16), 10 * total
        return 2 * votes > total

    def ours() -> Tensor:
        votes = single[0]
        for one in single[1:]:
            votes, _ = merged(votes, one, 0.1)
        return bits.unpack(votes.majority(), d)[0]

    return naive, ours, shares > Fraction(1, 2)


CASES = [
    Case("counting", "distances above 255",
         "opposite hypervectors: sums of bits kept in bytes wrap at 256",
         "numpy.bitwise_count, summed in uint8", "hdc.bits.hamming", "bits",
         largest, distances_above_255),
    *(Case("counting", f"ties of {readout}",
           "50 of 51 classes equally near to every query: the lowest index is expected",
           "topk(1)", f"HDCClassifier(readout={readout!r})", "queries",
           differing, partial(ties, readout))
      for readout in ("majority", "counts", "neighbours")),
    Case("counting", "counters above 2^16", "70,000 samples in a class: 16-bit counters wrap",
         "uint16 counters", "hdc.prototypes.Counters", "counts",
         largest, counters_above_2_to_the_16),
    Case("counting", "repeated merges",
         "twelve merges of a tenth: votes of 10^12 do not fit, and are halved",
         "uint16 votes", "hdc.prototypes.merged", "bits", differing, repeated_merges),
]  # fmt: skip
