"""Prototypes that learn from their mistakes: one pass, on packed bits.

AdaptHD (Imani et al., BioCAS 2019) and OnlineHD (Hernández-Cano et al., DATE 2021) add a
hypervector that was taken for another class to its own prototype and subtract it from the other.
Written in ±1, subtracting a hypervector is adding its complement, so both are further hypervectors
in a bundle: the counters of :mod:`hdc.prototypes` and their majority serve as they are, and nothing
is kept of a sample but what it added to them.

While a class has few samples, a correction outvotes them wherever they are tied, and its prototype
turns away from what all classes have in common: on simulated touch frames that costs accuracy up to
some tens of samples, and gains next to none beyond (results/tables/accuracy_vs_n.md).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.classifier import HDCClassifier, _tensor
from hdc.prototypes import Counters


class OnlineHDCClassifier(HDCClassifier):
    """:class:`hdc.HDCClassifier` that weights a sample by whether it was recognised.

    Each frame is first classified with the prototypes of the frames before it, then counted: so
    many times as `bundle` says in its own class, and, if it was taken for another one, `correction`
    times more there and as often with its complement in the class it was taken for. The first frame
    of a class corrects nothing. The order of the frames matters.

    Args:
        bundle: how often every sample is counted; 0 learns from mistakes alone (and from the first
            sample of a class), as AdaptHD does.
        correction: how often a mistake is; 0 is HDCClassifier.
        ties, seed, device: as of HDCClassifier.

    Attributes:
        counts_: int64 array [L], hypervectors in each bundle, corrections included.

    Others are those of HDCClassifier.

    Raises:
        ValueError: in ``fit``, ``train`` and ``partial_fit``, for weights that are no integers from
            0, or both 0.
    """

    prototype = "binary"
    backend = "numpy"

    def __init__(
        self,
        bundle: int = 2,
        correction: int = 1,
        ties: str = "zero",
        seed: int = 0,
        device: str = "cpu",
    ):
        self.bundle = bundle
        self.correction = correction
        self.ties = ties
        self.seed = seed
        self.device = device

    def __repr__(self) -> str:
        return f"Online{super().__repr__()}"

    def _check_parameters(self) -> None:
        super()._check_parameters()
        for name, value in (("bundle", self.bundle), ("correction", self.correction)):
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ValueError(f"{name}: expected an integer from 0, found {value!r}")
        if self.bundle == self.correction == 0:
            raise ValueError("bundle, correction: expected one above 0, found 0 and 0")

    def _count(self, frames: Any, labels: np.ndarray, first: int) -> None:
        frames = _tensor(frames)
        if len(frames) and not hasattr(self, "counters_"):
            # The first sample, which is the only one of its counters: plane 0 is its hypervector.
            super()._count(frames[:1], labels[:1], first)
            words = self.counters_.planes[:, 0]
            self.counters_ = self._online(Counters(1, self.dimension_, self.device))
            self.counters_.add(words, torch.zeros(1, dtype=torch.int64))
            frames, labels, first = frames[1:], labels[1:], first + 1
        elif hasattr(self, "counters_") and not isinstance(self.counters_, OnlineCounters):
            self.counters_ = self._online(self.counters_)  # read from a file
        super()._count(frames, labels, first)

    def _online(self, counters: Counters) -> OnlineCounters:
        online = OnlineCounters(len(counters.n), counters.dimension, self.device)
        online.planes, online.n = counters.planes, counters.n
        online.bundle, online.correction = self.bundle, self.correction
        online.ties, online.seed = self.ties, self.seed
        return online


class OnlineCounters(Counters):
    """Counters to which a sample is added by what their prototypes take it for."""

    bundle = 2
    correction = 1
    ties = "zero"
    seed = 0

    def add(self, words: Tensor, labels: Tensor) -> None:
        """Classify and count hypervectors int64 [N, W] of classes int64 [N], one after another."""
        inside = bits.pack(torch.ones(self.dimension, dtype=torch.bool)).to(words.device)
        prototypes = torch.zeros_like(self.planes[:, 0])
        for c in self.n.nonzero().flatten().tolist():
            prototypes[c] = self._prototype(c)
        for row, label in zip(words, labels.tolist(), strict=True):
            known = self.n[label] > 0
            # (hypervector, class, times)
            adds = [(row, label, self.bundle if known else max(1, self.bundle))]
            if known and (taken := self._nearest(row, prototypes)) != label:
                adds[0] = (row, label, self.bundle + self.correction)
                adds.append((~row & inside, taken, self.correction))
            rows = [word for word, _, times in adds for _ in range(times)]
            classes = [c for _, c, times in adds for _ in range(times)]
            if rows:
                super().add(torch.stack(rows), torch.tensor(classes))
            for c in set(classes):
                prototypes[c] = self._prototype(c)

    def _nearest(self, row: Tensor, prototypes: Tensor) -> int:
        """The class of the nearest prototype, among those that have samples."""
        distances = bits.hamming(row[None], prototypes)[0].cpu()
        return int(distances.masked_fill(self.n == 0, self.dimension + 1).argmin())

    def _prototype(self, c: int) -> Tensor:
        n = int(self.n[c])
        breaker = None
        if self.ties == "random" and n % 2 == 0:
            breaker = self._tie_breaker(self.seed, c)
        return bits.majority_of_counts(self.planes[c], n, self.ties, breaker)
