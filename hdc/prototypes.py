"""Class prototypes: counters of ones a class, their majority, and recalibration.

Training is counting: a class is the number of its hypervectors and, for each bit, how many of them
have it set. Counts are kept bit-sliced (:mod:`hdc.planes`), L·P·D bits for classes of fewer than
2^P samples. Adding and merging commute, so any order and any sharding give the same prototypes.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from hdc import bits, planes


class Counters:
    """Counts of ones for L classes of D-bit hypervectors.

    Args:
        n_classes: L.
        dimension: D.
        device: where the counts live.
        backend: ``"compiled"`` counts by :mod:`hdc.compiled`, to the same counts.

    Attributes:
        planes: int64 [L, P, W], the counts, bit-sliced.
        n: int64 [L] (CPU), how many hypervectors each class has.
    """

    def __init__(
        self,
        n_classes: int,
        dimension: int,
        device: torch.device | str = "cpu",
        backend: str = "numpy",
    ):
        if dimension < 1:
            raise ValueError(f"dimension: expected at least 1, found {dimension}")
        self.dimension = dimension
        self.backend = backend
        self.n = torch.zeros(n_classes, dtype=torch.int64)
        self.planes = planes.zeros((n_classes, 1, bits.words_for(dimension)), device)

    def add(self, words: Tensor, labels: Tensor) -> None:
        """Count hypervectors int64 [N, W] with class indices int64 [N] in [0, L).

        Raises:
            ValueError: if lengths or widths disagree or a label is outside [0, L).
        """
        bits._check_width(words, self.dimension)
        labels = labels.cpu()
        if len(words) != len(labels):
            raise ValueError(f"labels: expected {len(words)}, one a sample, found {len(labels)}")
        outside = labels[(labels < 0) | (labels >= len(self.n))]
        if len(outside):
            raise ValueError(
                f"labels: expected class indices in [0, {len(self.n)}), found {int(outside[0])}"
            )
        n = torch.bincount(labels, minlength=len(self.n)) if len(labels) else self.n * 0
        total = self.n + n
        self._grow(int(total.max()).bit_length() if len(total) else 0)
        order = labels.argsort(stable=True)
        if kernels := bits.kernels(self.backend, self.device):
            kernels.count_into(*(x.numpy() for x in (self.planes, words, order, n.cumsum(0))))
        else:
            rows, start = order.tolist(), 0
            for c, n_c in enumerate(n.tolist()):
                if n_c:
                    planes.count_into(self.planes[c], words, rows[start : start + n_c])
                    start += n_c
        self.n = total

    def merge(self, other: Counters) -> None:
        """Add another set of counters of the same classes and dimension to this one."""
        if (len(self.n), self.dimension) != (len(other.n), other.dimension):
            raise ValueError(
                f"merge: expected {len(self.n)} classes of D = {self.dimension}, "
                f"found {len(other.n)} of D = {other.dimension}"
            )
        total = self.n + other.n
        self._grow(int(total.max()).bit_length() if len(total) else 0)
        for c, counts in enumerate(other.planes.to(self.planes.device)):
            self.planes[c] = planes.add(self.planes[c], counts)[: self.planes.shape[1]]
        self.n = total

    def append_classes(self, n_new: int) -> None:
        """Make room for further classes, at the end, with counts of zero."""
        self.n = torch.cat((self.n, self.n.new_zeros(n_new)))
        _, n_planes, width = self.planes.shape
        self.planes = torch.cat((self.planes, self.planes.new_zeros(n_new, n_planes, width)))

    def reorder(self, order: Sequence[int]) -> None:
        """Put class order[i] in place i."""
        index = torch.as_tensor(order)
        self.n, self.planes = self.n[index], self.planes[index.to(self.planes.device)]

    def majority(self, ties: str = "zero", seed: int = 0) -> Tensor:
        """Prototypes int64 [L, W] by bitwise majority (paper, Eq. 1).

        Args:
            ties: what becomes of a bit with as many ones as zeros; see :func:`hdc.bits.majority`.
            seed: for ``ties="random"``; class c takes the random hypervector of (seed, c).

        Raises:
            ValueError: for a class without samples or an unknown rule.
        """
        if (self.n == 0).any():
            raise ValueError(
                f"class {int((self.n == 0).nonzero()[0])}: expected at least one sample, found none"
            )
        prototypes = torch.empty_like(self.planes[:, 0])
        for c, n in enumerate(self.n.tolist()):
            breaker = None
            if ties == "random" and n % 2 == 0:
                breaker = self._tie_breaker(seed, c)
            prototypes[c] = bits.majority_of_counts(self.planes[c], n, ties, breaker)
        return prototypes

    def counts(self) -> Tensor:
        """The counts as integers: int64 [L, D]."""
        total = torch.zeros(len(self.n), self.dimension, dtype=torch.int64, device=self.device)
        for p in range(self.planes.shape[1]):
            total += bits.unpack(self.planes[:, p], self.dimension).long() << p
        return total

    @property
    def device(self) -> torch.device:
        return self.planes.device

    def _grow(self, n_planes: int) -> None:
        """Make room for counts of n_planes bits."""
        n_classes, n_old, width = self.planes.shape
        if n_planes > n_old:
            grown = planes.zeros((n_classes, n_planes, width), self.device)
            if grown.device.type == "cpu":  # without torch's threads, as planes.zeros
                grown.numpy()[:, :n_old] = self.planes.numpy()
            else:
                grown[:, :n_old] = self.planes
            self.planes = grown

    def _tie_breaker(self, seed: int, c: int) -> Tensor:
        seed = (seed * 1_000_003 + c) % 2**63  # what torch's generator takes
        return bits.random_hypervector(self.dimension, seed).to(self.device)


def recalibrate(stored: Tensor, new: Tensor, dimension: int, p: float, seed: int = 0) -> Tensor:
    """Replace each bit of the stored prototypes by the new ones' with probability p.

    The adaptive update of the paper's Section III.B (Fig. 8(a)): ``p = 0`` keeps the stored
    prototypes int64 [L, W], ``p = 1`` takes the new ones.

    Raises:
        ValueError: if p is not in [0, 1] or the shapes differ.
    """
    if not 0 <= p <= 1:
        raise ValueError(f"p: expected a probability in [0, 1], found {p}")
    if stored.shape != new.shape:
        raise ValueError(
            f"recalibrate: expected prototypes of one shape, found {tuple(stored.shape)} "
            f"and {tuple(new.shape)}"
        )
    chosen = bits.random_hypervector(dimension * len(stored), seed, p)
    mask = bits.pack(bits.unpack(chosen, dimension * len(stored)).view(len(stored), dimension))
    return stored ^ ((stored ^ new) & mask.to(stored.device))
