"""The published read-out: the bitwise majority of a class, nearest in Hamming distance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from hdc import bits, planes
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_choice, check_integer, check_share
from hdc.prototypes import Counters, merged, replaced_bits
from hdc.readouts.base import HeldOut, State, Updatable
from hdc.tensors import Kinds

METHODS = ("replace", "merge")
WEIGHTS = (None, "balanced")
EXTRAS = (-2, -1, 0, 1, 2)
"""Numbers of additional hypervectors, for which :mod:`hdc.conformal` needs prototypes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Counted(State):
    """Counts of ones per class, and their majority."""

    kinds: ClassVar[Kinds] = {
        "planes": "int64 L P W",
        "n": "int64 L",
        "prototypes": "int64 L W",
        "recalibrated": "int64",
        "deciding": "int64 L 5 W",
    }
    planes: Tensor
    """int64 [L, P, W], the counts, bit-sliced (:mod:`hdc.planes`)."""
    n: Tensor
    """int64 [L] (CPU), hypervectors of each class, or votes after a recalibration by votes."""
    prototypes: Tensor
    """int64 [L, W]; zeros for a class without training frames."""
    recalibrated: Tensor
    """int64 [], how often; if above 0, prototypes do not follow from the counts."""
    deciding: Tensor | None = None
    """int64 [L, 5, W], prototypes for :data:`EXTRAS`, if they do not follow from the counts."""

    dimension: int

    def check(self) -> None:
        out_of_range = (self.n < 0) | (self.n >= 2**53)
        if out_of_range.any() or not self.n.any():
            raise ValueError(f"sample counts {self.n.tolist()}")

    def counters(self) -> Counters:
        """The counts."""
        return Counters.of(self.planes, self.n, self.dimension)


class Counting(Updatable):
    """Base class of read-outs that count ones per class: Majority and Counts."""

    State = Counted
    renamed: ClassVar = {"balance": "class_weight", "seed": "random_state"}
    methods: ClassVar[tuple[str, ...]] = METHODS
    """Methods of recalibration; the first is the default."""

    def __init__(
        self, ties: str = "zero", class_weight: str | None = None, random_state: int = 0
    ):
        self.ties = ties
        self.class_weight = class_weight
        self.random_state = random_state

    def check(self) -> None:
        check_choice("ties", self.ties, planes.TIES)
        check_choice("class_weight", self.class_weight, WEIGHTS)
        check_integer("random_state", self.random_state)

    @classmethod
    def of_today(cls, parameters: Mapping[str, Any]) -> dict[str, Any]:
        found = super().of_today(parameters)
        if isinstance(found.get("class_weight"), bool):  # ``balance`` up to 3.0
            found["class_weight"] = WEIGHTS[found["class_weight"]]
        return found

    # Counting ------------------------------------------------------------------------------------

    def empty(
        self, n_classes: int, dimension: int, device: torch.device | str
    ) -> Counted:
        width = bits.words_for(dimension)
        prototypes = torch.zeros(n_classes, width, dtype=torch.int64, device=device)
        return Counted(
            planes=prototypes[:, None],
            n=torch.zeros(n_classes, dtype=torch.int64),
            prototypes=prototypes,
            recalibrated=torch.tensor(0),
            dimension=dimension,
        )

    def add(
        self, state: Counted, batches: Iterable[tuple[Hypervectors, Tensor]]
    ) -> Counted:
        counts, n = state.planes.clone(), state.n
        for words, rows in batches:
            counts, n = planes.count_classes(counts, n, words.packed, rows)
        return self._with_prototypes(replace(state, planes=counts, n=n))

    def arrange(self, state: Counted, places: Sequence[int], n_classes: int) -> Counted:
        counters = state.counters().placed(places, n_classes)
        arranged = replace(state, planes=counters.planes, n=counters.n)
        return self._with_prototypes(arranged)

    def _with_prototypes(self, state: Counted) -> Counted:
        """The state with the prototypes of its counts."""
        counted: Counted | Counters = state
        if self.class_weight is not None:
            counted = state.counters().thinned(smallest(state.n), self.random_state)
        made = planes.majorities(counted.planes, counted.n, self.ties)
        return replace(state, prototypes=made)

    # Adapting ------------------------------------------------------------------------------------

    def adapt(
        self,
        state: Counted,
        words: Hypervectors,
        rows: Tensor,
        share: float,
        random_state: int,
        method: str | None,
    ) -> Counted:
        """Move the prototypes of some classes to new hypervectors.

        Args:
            state: the trained state.
            words, rows: the new hypervectors and their classes int64 [N].
            share: probability that a bit is replaced, or weight of the new hypervectors.
            random_state: seed of the choice of bits to replace.
            method: ``"replace"``, as published, or ``"merge"`` (:func:`hdc.prototypes.merged`);
                None is the first of `methods`.

        Raises:
            ValueError: for a share outside [0, 1], a seed that is no integer, an unknown method, or
                bits to be replaced in a class without a prototype.
        """
        check_share("p", share, "[0, 1]")
        check_integer("random_state", random_state)
        method = self.methods[0] if method is None else method
        check_choice("method", method, self.methods)
        known, place = rows.unique(return_inverse=True)
        classes = known.tolist()
        if method == "replace" and (state.n[classes] == 0).any():
            raise ValueError(
                "recalibrate: expected classes with training frames, found new frames of one "
                "without; method='merge' or partial_fit learns it"
            )
        new = Counters(len(classes), state.dimension, words.packed.device)
        new.add(words.packed, place)
        deciding = self.deciding(state).clone()
        move = self._merge_votes if method == "merge" else self._replace_bits
        moved, deciding[classes] = move(state, new, classes, share, random_state)
        return replace(moved, deciding=deciding, recalibrated=state.recalibrated + 1)

    def _merge_votes(
        self, state: Counted, new: Counters, classes: list[int], share: float, seed: int
    ) -> tuple[Counted, Tensor]:
        """The state by votes of old and new hypervectors; and prototypes for EXTRAS, [K, 5, W]."""
        old = state.counters()
        if self.class_weight is not None:
            new = new.thinned(smallest(new.n), seed)
            if not state.recalibrated:
                old = old.thinned(smallest(old.n), self.random_state)
        placed = new.placed(classes, len(old.n))
        votes, weights = merged(old, placed, share)
        prototypes = votes.majority(self.ties)
        voted = replace(state, planes=votes.planes, n=votes.n, prototypes=prototypes)
        near = [self._deciding_of(voted, c, weights[c]) for c in classes]
        return voted, torch.stack(near)

    def _replace_bits(
        self, state: Counted, new: Counters, classes: list[int], share: float, seed: int
    ) -> tuple[Counted, Tensor]:
        """The state with bits replaced at random (paper, Fig. 8(a)); and prototypes as above."""
        number = int(state.recalibrated)
        drawn = replaced_bits(len(state.n), new.dimension, share, seed, number)
        mask = drawn[classes].to(state.prototypes.device)
        bundled = new
        if self.class_weight is not None:
            bundled = new.thinned(smallest(new.n), self.random_state)
        fresh = bundled.majority(self.ties)
        counted = replace(state, planes=new.planes, n=new.n)
        near = torch.stack([self._deciding_of(counted, i) for i in range(len(classes))])
        before = state.prototypes[classes]
        after = state.prototypes.clone()
        after[classes] = bits.where(mask, fresh, before)
        decided = bits.where(mask[:, None], near, before[:, None])
        return replace(state, prototypes=after), decided

    # Left out ------------------------------------------------------------------------------------

    def deciding(self, state: Counted) -> Tensor:
        """Prototypes int64 [L, 5, W] for numbers of hypervectors n + :data:`EXTRAS`."""
        if state.deciding is not None:
            return state.deciding
        n_classes, width = state.prototypes.shape
        decided = state.prototypes.new_zeros(n_classes, len(EXTRAS), width)
        for c in state.n.nonzero().flatten().tolist():
            decided[c] = self._deciding_of(state, c)
        return decided

    def _deciding_of(self, state: Counted, c: int, weight: int = 1) -> Tensor:
        """Bits of class c with more than (n + weight·extra)/2 ones, for EXTRAS: int64 [5, W].

        They give the prototype without one hypervector of the class: its bits are those for
        ``extra=1`` where the hypervector has a one, since 2·(count − 1) > n − 1 if and only if
        2·count > n + 1, and those for ``extra=-1`` where it has a zero. If another hypervector
        takes its place, the bits are those for ``extra=2`` where a one becomes a zero, and for
        ``extra=-2`` where a zero becomes a one.
        """
        counts, n = state.planes[c], int(state.n[c])
        made = []
        for extra in EXTRAS:
            n_with = n + weight * extra
            made.append(planes.majority(counts, n_with, self.ties))
        # For a negative n every count is a majority, also beyond bit D.
        all_ones = torch.ones(state.dimension, dtype=torch.bool)
        inside = bits.pack(all_ones).to(counts.device)
        return torch.stack(made) & inside

    def distances(self, state: Counted, words: Hypervectors) -> Tensor:
        """Hamming distances int64 [Q, L] to the prototypes; D + 1 for a class without frames."""
        distances = bits.hamming(words.packed, state.prototypes)
        if 0 in state.n.tolist():
            distances[:, state.n == 0] = words.dimension + 1
        return distances


class Majority(Counting):
    """Nearest prototype in Hamming distance; a prototype is the bitwise majority of its class.

    Kitagawa et al., Opt. Express 32, 3209 (2024), Eqs. 1 to 3. Training is counting.

    Args:
        ties: what a prototype bit with as many ones as zeros becomes: ``"zero"``, as published, or
            ``"one"``.
        class_weight: None, as published, or ``"balanced"``. The more frames a majority bundles, the
            more its prototype correlates with every frame, so that by Eq. 1 a larger class wins
            frames of the others, already with 5 frames against 4. If balanced, prototypes are made
            as if each class had as many frames as the smallest
            (:meth:`hdc.prototypes.Counters.thinned`); for classes of equal size nothing changes.
        random_state: seed of balancing.
    """

    needs = ("prototypes",)

    def scores(self, state: Counted, words: Hypervectors) -> Tensor:
        """Minus the Hamming distances, int64 [Q, L]."""
        return -self.distances(state, words)

    def held_out(
        self, state: Counted, words: Hypervectors | None, rows: Tensor
    ) -> HeldOut:
        """Minus the distances, of which the one to the frame's own class is without the frame.

        The frame changes this distance as it changes the distance to the majority of all frames of
        the class, even if the prototype is thinned.
        """
        assert words is not None
        scores = self.scores(state, words).double().cpu()
        deciding = self.deciding(state)
        for c in rows.unique().tolist():
            _, if_zero, whole, if_one, _ = deciding[c]
            places = (rows == c).nonzero().flatten()
            own = words[places].packed
            without = bits.where(own, if_one, if_zero)
            farther = bits.count_ones(own ^ without) - bits.count_ones(own ^ whole)
            scores[places, c] -= farther.cpu()
        return HeldOut(scores, rows)


def smallest(n: Tensor) -> int:
    """Number of frames of the smallest class of n [L] that is not empty; 0 if all are."""
    found = n[n > 0]
    return int(found.min()) if len(found) else 0
