"""Class prototypes: counters of ones a class, their majority, and recalibration.

Training is counting: a class is the number of its hypervectors and, for each bit, how many of them
have it set. Counts are kept bit-sliced (:mod:`hdc.planes`), L·P·D bits for classes of fewer than
2^P samples. Adding and merging commute, so any order and any sharding give the same prototypes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from hdc import bits, planes

# Streams of random bits from one seed.
_TIES, _RECALIBRATION = range(2)


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
        self._room: Tensor | None = None  # what planes is the beginning of, once classes came later

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
        self.reserve(max(total.tolist(), default=0))
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

    def merge(self, other: Counters, rows: Sequence[int] | None = None) -> None:
        """Add another set of counters of the same dimension to this one.

        Args:
            other: counters of the same classes, or of some of them.
            rows: places here of the other's classes; by default, the same places.

        Raises:
            ValueError: if dimensions or numbers of classes disagree.
        """
        n_classes = len(self.n) if rows is None else len(rows)
        if (n_classes, self.dimension) != (len(other.n), other.dimension):
            raise ValueError(
                f"merge: expected {n_classes} classes of D = {self.dimension}, "
                f"found {len(other.n)} of D = {other.dimension}"
            )
        rows = range(n_classes) if rows is None else rows
        total = self.n.clone()
        total[list(rows)] += other.n
        self.reserve(max(total.tolist(), default=0))
        for c, counts in zip(rows, other.planes.to(self.planes.device), strict=True):
            self.planes[c] = planes.add(self.planes[c], counts)[: self.planes.shape[1]]
        self.n = total

    def scaled(self, weights: Sequence[int]) -> Counters:
        """Counters in which every hypervector of class c was counted weights[c] ≥ 0 times."""
        scaled = Counters(len(self.n), self.dimension, self.device)
        scaled.n = self.n * torch.tensor(weights, dtype=torch.int64)
        scaled.reserve(max(scaled.n.tolist(), default=0))
        for c, weight in enumerate(weights):
            total = torch.zeros_like(self.planes[c, :1])
            for bit in f"{weight:b}":  # Horner's scheme: twice what there is, and once more
                total = torch.cat((torch.zeros_like(total[:1]), total))
                total = planes.add(total, self.planes[c]) if bit == "1" else total
            kept = min(len(total), scaled.planes.shape[1])  # the planes above are empty
            scaled.planes[c, :kept] = total[:kept]
        return scaled

    @classmethod
    def from_counts(cls, counts: Tensor, n: Tensor) -> Counters:
        """Counters of counts, integers [L, D], of n hypervectors a class, int64 [L].

        Raises:
            ValueError: for a count outside 0 to n of its class.
        """
        n = n.cpu().long()
        outside = (counts < 0) | (counts > n.to(counts.device)[:, None])
        if outside.any():
            c = int(outside.any(1).nonzero()[0])
            raise ValueError(
                f"class {c}: expected counts from 0 to {int(n[c])}, "
                f"found {int(counts[c][outside[c]][0])}"
            )
        counters = cls(len(n), counts.shape[1], counts.device)
        counters.reserve(max(n.tolist(), default=0))
        counters.n = n
        for p in range(counters.planes.shape[1]):
            counters.planes[:, p] = bits.pack((counts >> p) & 1 == 1)
        return counters

    def append_classes(self, n_new: int) -> None:
        """Make room for further classes, at the end, with counts of zero.

        Room is made for as many classes again, so that classes that come one by one are copied
        about once each; memory that no class has used yet is not taken from the system.
        """
        self.n = torch.cat((self.n, self.n.new_zeros(n_new)))
        n_old, n_planes, width = self.planes.shape
        room = self._room
        if (
            room is None
            or room.data_ptr() != self.planes.data_ptr()  # planes were replaced since
            or room.shape[1] != n_planes
            or len(room) < len(self.n)
        ):
            room = planes.zeros((max(len(self.n), 2 * n_old), n_planes, width), self.device)
            _copy(room[:n_old], self.planes)
        self._room = room
        self.planes = room[: len(self.n)]

    def reorder(self, order: Sequence[int]) -> None:
        """Put class order[i] in place i; classes before the first that moves are not copied."""
        first = next((i for i, c in enumerate(order) if i != c), len(order))
        index = torch.as_tensor(order[first:], dtype=torch.int64)
        self.n[first:] = self.n[index]
        self.planes[first:] = self.planes[index.to(self.planes.device)]

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
        for c in range(len(self.n)):
            prototypes[c] = self.prototype(c, ties, seed)
        return prototypes

    def prototype(self, c: int, ties: str = "zero", seed: int = 0, extra: int = 0) -> Tensor:
        """The majority of one class, int64 [W]; arguments as of :meth:`majority`.

        Leaving out a hypervector of the class changes bit j of its prototype to that of
        ``extra=1`` where the hypervector has a one, and of ``extra=-1`` where it has a zero:
        2·(count − 1) > n − 1 if and only if 2·count > n + 1, and 2·count > n − 1.

        Args:
            c: row of the class.
            ties, seed: see :meth:`majority`.
            extra: how many hypervectors of zeros alone are counted besides.
        """
        n, breaker = int(self.n[c]) + extra, None
        if ties == "random" and n % 2 == 0:
            breaker = self._tie_breaker(seed, c)
        return bits.majority_of_counts(self.planes[c], n, ties, breaker)

    def counts(self, dtype: torch.dtype = torch.int64) -> Tensor:
        """The counts as integers [L, D], of a type that holds the largest."""
        total = torch.zeros(len(self.n), self.dimension, dtype=dtype, device=self.device)
        for p in range(self.planes.shape[1]):
            total += bits.unpack(self.planes[:, p], self.dimension).to(dtype) << p
        return total

    @property
    def device(self) -> torch.device:
        return self.planes.device

    def reserve(self, n: int) -> None:
        """Make room for n hypervectors a class."""
        n_planes = n.bit_length()
        n_classes, n_old, width = self.planes.shape
        if n_planes > n_old:
            grown = planes.zeros((n_classes, n_planes, width), self.device)
            _copy(grown[:, :n_old], self.planes)
            self.planes = grown

    def __getstate__(self) -> dict[str, Any]:
        whole = self.planes if self._room is None else self.planes.clone()
        return vars(self) | {"planes": whole, "_room": None}

    def _tie_breaker(self, seed: int, c: int) -> Tensor:
        return bits.random_hypervector(self.dimension, seed, stream=(_TIES, c)).to(self.device)


def _copy(into: Tensor, source: Tensor) -> None:
    if into.device.type == "cpu":  # without torch's threads, as planes.zeros
        into.numpy()[:] = source.numpy()
    else:
        into.copy_(source)


def recalibrate(stored: Tensor, new: Tensor, dimension: int, p: float, seed: int = 0) -> Tensor:
    """Replace each bit of the stored prototypes by the new ones' with probability p.

    The adaptive update of the paper's Section III.B (Fig. 8(a)): ``p = 0`` keeps the stored
    prototypes int64 [L, W], ``p = 1`` takes the new ones.

    Raises:
        ValueError: if p is not in [0, 1] or the shapes differ.
    """
    check_share(p)
    if stored.shape != new.shape:
        raise ValueError(
            f"recalibrate: expected prototypes of one shape, found {tuple(stored.shape)} "
            f"and {tuple(new.shape)}"
        )
    mask = replaced_bits(len(stored), dimension, p, seed)
    return stored ^ ((stored ^ new) & mask.to(stored.device))


def replaced_bits(n_classes: int, dimension: int, p: float, seed: int) -> Tensor:
    """The bits that :func:`recalibrate` replaces: int64 [L, W] (CPU), ones with probability p.

    Class c draws its bits from (seed, c).
    """
    check_share(p)
    chosen = (
        bits.random_hypervector(dimension, seed, p, stream=(_RECALIBRATION, c))
        for c in range(n_classes)
    )
    return torch.stack(list(chosen))


def check_share(p: float) -> None:
    """Check that p is a probability.

    Raises:
        ValueError: if it is not in [0, 1].
    """
    if not 0 <= p <= 1:
        raise ValueError(f"p: expected a probability in [0, 1], found {p}")
