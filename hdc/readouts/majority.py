"""The published read-out: the bitwise majority of a class, nearest in Hamming distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from hdc import bits, planes
from hdc.parameters import check_choice, check_share
from hdc.prototypes import Counters, merged, replaced_bits
from hdc.readouts.base import HeldOut, Updatable
from hdc.tensors import checked

METHODS = ("replace", "merge")
EXTRAS = (-2, -1, 0, 1, 2)
"""Hypervectors more or less that :mod:`hdc.conformal` asks for, as `extra` of
:meth:`hdc.prototypes.Counters.prototype`."""

KINDS = {
    "planes": "int64 L P W",
    "n": "int64 L",
    "prototypes": "int64 L W",
    "recalibrated": "int64",
    "deciding": "int64 L 5 W",
}
"""What is kept in a file; `deciding` after a recalibration only."""


class Counting(Updatable):
    """Counters of ones per class and their majority; what Majority and Counts share.

    Attributes:
        counters_: the counts, :class:`hdc.prototypes.Counters`.
        prototypes_: int64 [L, W], the packed prototypes; zeros for a class without samples.
        recalibrated_: recalibrations so far; with any, prototypes are no longer those of the
            counted hypervectors.
    """

    methods: ClassVar[tuple[str, ...]] = METHODS
    """Ways to adapt, the first by default."""
    counters_: Counters
    prototypes_: Tensor
    recalibrated_: int
    _size: int | None
    """Samples per class that prototypes count as; −1: none are made yet."""
    _changed: set[int]  # classes that have samples that their prototypes have not
    _deciding: Tensor | None  # [L, 5, W], see EXTRAS, where counters do not tell them

    def __init__(self, ties: str = "zero", balance: bool = False, seed: int = 0):
        self.ties = ties
        self.balance = balance
        self.seed = seed

    def check(self) -> None:
        check_choice("ties", self.ties, bits.TIES)
        check_choice("balance", self.balance, (True, False))
        if isinstance(self.seed, bool) or not isinstance(self.seed, Integral):
            raise ValueError(f"seed: expected an integer, found {self.seed!r}")

    def start(self, n_classes: int, dimension: int, device: torch.device | str) -> Self:
        """Be ready to count for so many classes."""
        self.counters_ = Counters(n_classes, dimension, device)
        self.recalibrated_ = 0
        self._deciding = None
        self._reset()
        return self

    def fit(self, words: Tensor, rows: Tensor, n_classes: int, dimension: int) -> Self:
        self.start(n_classes, dimension, words.device)
        self.add(words, rows)
        self.settle()
        return self

    def add(self, words: Tensor, rows: Tensor) -> None:
        self.counters_.backend = self.backend
        self.counters_.add(words, rows)
        self._changed |= set(rows.tolist())

    def add_frames(
        self,
        frames: Tensor,
        rows: Tensor,
        chosen: Sequence[int],
        n_ones: int,
        ties: str,
    ) -> tuple[Tensor, Any, Any]:
        """:meth:`hdc.prototypes.Counters.add_frames`."""
        self._changed |= set(rows.tolist())
        return self.counters_.add_frames(frames, rows, chosen, n_ones, ties)

    def settle(self) -> None:
        """Make the prototypes of classes that have more samples, or all where that changes them."""
        counters = self.counters_
        size = self._common_size()
        # Others may be reading the ones of before.
        prototypes = torch.empty_like(self.prototypes_)
        planes.plain(prototypes)[:] = planes.plain(self.prototypes_)
        changed = self._changed
        if size != self._size:
            changed = set(range(len(counters.n)))
        for c in changed:
            if counters.n[c]:
                made = counters.prototype(c, self.ties, self.seed, size=size)
                prototypes[c] = made
        self.prototypes_ = prototypes
        self._size = size
        self._changed = set()

    def arrange(self, places: Sequence[int], n_classes: int) -> None:
        old = self.counters_
        self.counters_ = Counters(n_classes, old.dimension, old.device)
        self.counters_.merge(old, places)
        self._reset()

    def merge(self, other: Self, places: Sequence[int]) -> None:
        self.counters_.merge(other.counters_, places)
        self._changed |= set(places)

    def adapt(
        self, words: Tensor, rows: Tensor, share: float, seed: int, method: str | None
    ) -> None:
        """Move the prototypes of some classes to new hypervectors.

        Args:
            words, rows: the new hypervectors int64 [N, W] and their classes int64 [N].
            share: probability with which a bit is replaced, or share of the new in the votes.
            seed: of the choice of bits that are replaced.
            method: ``"replace"``, as published, or ``"merge"`` (:func:`hdc.prototypes.merged`);
                None is the first of `methods`.

        Raises:
            ValueError: for a share outside [0, 1], an unknown method, or bits to be replaced of a
                class that has no prototype.
        """
        check_share("p", share, "[0, 1]")
        method = self.methods[0] if method is None else method
        check_choice("method", method, self.methods)
        classes = rows.unique().tolist()
        if method == "replace" and (self.counters_.n[classes] == 0).any():
            raise ValueError(
                "recalibrate: expected classes with training frames, found new frames of one "
                "without; method='merge' or partial_fit learns it"
            )
        dimension = self.counters_.dimension
        new = Counters(len(classes), dimension, words.device, self.backend)
        places = torch.searchsorted(torch.tensor(classes), rows)
        new.add(words, places)
        size = smallest(new) if self.balance else None
        if method == "merge":
            self._merge_votes(new, classes, share, seed, size)
        else:
            self._replace_bits(new, classes, share, seed, size)
        self.recalibrated_ += 1

    def _merge_votes(
        self,
        new: Counters,
        classes: list[int],
        share: float,
        seed: int,
        size: int | None,
    ) -> None:
        """Prototypes of the votes of old and new hypervectors."""
        old = self.counters_
        deciding = self.deciding()
        if self.balance and not self.recalibrated_:
            old = old.thinned(smallest(old), self.seed)
        if size:
            new = new.thinned(size, seed)
        placed = Counters(len(old.n), old.dimension, old.device)
        placed.merge(new, classes)
        votes, weights = merged(old, placed, share)
        for c in classes:
            deciding[c] = deciding_prototypes(
                votes, c, self.ties, self.seed, weights[c]
            )
        self.counters_ = votes
        self._deciding = deciding
        self.prototypes_ = votes.majority(self.ties, self.seed)

    def _replace_bits(
        self,
        new: Counters,
        classes: list[int],
        share: float,
        seed: int,
        size: int | None,
    ) -> None:
        """Prototypes of which each bit is the new one's with a probability (paper, Fig. 8(a))."""
        before = self.prototypes_
        deciding = self.deciding()
        number = self.recalibrated_
        mask = replaced_bits(len(before), new.dimension, share, seed, number)
        mask = mask.to(before.device)
        after = before.clone()
        fresh = new.majority(self.ties, self.seed, size)
        for i, c in enumerate(classes):
            after[c] ^= (before[c] ^ fresh[i]) & mask[c]
            near = deciding_prototypes(new, i, self.ties, self.seed)
            replaced = (before[c] ^ near) & mask[c]
            deciding[c] = before[c] ^ replaced
        self.prototypes_ = after
        self._deciding = deciding

    def deciding(self) -> Tensor:
        """Prototypes [L, 5, W] with :data:`EXTRAS` hypervectors more, for :mod:`hdc.conformal`."""
        if self._deciding is not None:
            return self._deciding.clone()
        n_classes, width = self.prototypes_.shape
        decided = self.prototypes_.new_zeros(n_classes, len(EXTRAS), width)
        counters = self.counters_
        for c in counters.n.nonzero().flatten().tolist():
            decided[c] = deciding_prototypes(counters, c, self.ties, self.seed)
        return decided

    def distances(self, words: Tensor) -> Tensor:
        """Hamming distances int64 [Q, L] to the prototypes; D + 1 of a class without samples."""
        distances = bits.hamming(words, self.prototypes_, self.backend)
        counts = self.counters_.n
        if 0 in counts.tolist():
            distances[:, counts == 0] = self.counters_.dimension + 1
        return distances

    def stored(self) -> dict[str, Tensor]:
        tensors = {
            "planes": self.counters_.planes,
            "n": self.counters_.n,
            "prototypes": self.prototypes_,
            "recalibrated": torch.tensor(self.recalibrated_),
        }
        if self._deciding is not None:
            tensors["deciding"] = self._deciding
        return tensors

    def restore(
        self, tensors: Mapping[str, Tensor], n_classes: int, dimension: int
    ) -> None:
        kinds = dict(KINDS)
        if "deciding" not in tensors:
            del kinds["deciding"]
        found = checked(tensors, kinds, L=n_classes, D=dimension)
        n = found["n"]
        out_of_range = (n < 0) | (n >= 2**53)
        if out_of_range.any() or not n.any():
            raise ValueError(f"sample counts {n.tolist()}")
        counts = found["planes"]
        self.start(n_classes, dimension, counts.device)
        self.counters_.planes = counts
        self.counters_.n = n
        self.prototypes_ = found["prototypes"]
        self._deciding = found.get("deciding")
        self.recalibrated_ = int(found["recalibrated"])
        self._size = self._common_size()
        self._changed = set()

    def _common_size(self) -> int | None:
        """Samples a class that prototypes count as, where some classes are thinned."""
        if not self.balance:
            return None
        least = smallest(self.counters_)
        return least if (self.counters_.n > least).any() else None

    def _reset(self) -> None:
        """Have all prototypes made anew: random ties and thinned counts go by rows."""
        counters = self.counters_
        shape = len(counters.n), bits.words_for(counters.dimension)
        self.prototypes_ = planes.zeros(shape, counters.device)
        self._size = -1
        self._changed = set()


class Majority(Counting):
    """Nearest prototype in Hamming distance; a prototype is the bitwise majority of its class.

    Kitagawa et al., Opt. Express 32, 3209 (2024), Eqs. 1 to 3. Training is counting.

    Args:
        ties: a prototype bit with as many ones as zeros becomes ``"zero"`` (as published),
            ``"one"``, or, with ``"random"``, that of an extra random vector (Schmuck et al., ACM
            JETC 15, 32 (2019)).
        balance: True makes classes of unequal size comparable; False is Eq. 1. A majority raises a
            prototype's correlation with every frame, the more so the more frames it bundles, so
            that by Eq. 1 a larger class takes frames of the others, with 5 frames against 4
            already. With True, prototypes are made as if each class had as many frames as the
            smallest (:meth:`hdc.prototypes.Counters.thinned`); equal classes are as published.
        seed: of the random vectors for ``ties="random"``, and of `balance`.

    Attributes: as of :class:`Counting`.
    """

    predicts = ("prototypes",)

    def scores(self, words: Tensor) -> Tensor:
        """Minus the Hamming distances, int64 [Q, L]."""
        return -self.distances(words)

    def held_out(self, words: Tensor, rows: Tensor) -> HeldOut:
        """Minus the distances, that of the own class to its prototype without the frame.

        The own distance changes as it does with the prototype of all frames of the class, thinned
        or not.
        """
        scores = self.scores(words).double().cpu()
        deciding = self.deciding()
        for c in rows.unique().tolist():
            _, if_zero, whole, if_one, _ = deciding[c]
            places = (rows == c).nonzero().flatten()
            own = words[places.to(words.device)]
            without = (own & if_one) | (~own & if_zero)
            farther = bits.count_ones(own ^ without) - bits.count_ones(own ^ whole)
            scores[places, c] -= farther.cpu()
        return HeldOut(scores, rows)


def deciding_prototypes(
    counters: Counters, c: int, ties: str, seed: int, weight: int = 1
) -> Tensor:
    """The prototypes of class c with :data:`EXTRAS` hypervectors of a weight, int64 [5, W]."""
    extras = [weight * extra for extra in EXTRAS]
    made = [counters.prototype(c, ties, seed, extra) for extra in extras]
    # With fewer than no hypervectors every count is a majority, beyond bit D, too.
    all_ones = torch.ones(counters.dimension, dtype=torch.bool)
    inside = bits.pack(all_ones).to(counters.device)
    return torch.stack(made) & inside


def smallest(counters: Counters) -> int:
    """Samples of the smallest class that has any."""
    found = counters.n[counters.n > 0]
    return int(found.min()) if len(found) else 0
