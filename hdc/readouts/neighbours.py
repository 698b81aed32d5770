"""Nearest training frames; all hypervectors are stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from torch import Tensor

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_integer
from hdc.readouts.base import HeldOut, State, Updatable
from hdc.tensors import Kinds


@dataclass(frozen=True, kw_only=True, eq=False)
class Kept(State):
    """All training frames."""

    kinds: ClassVar[Kinds] = {"frames": "int64 N W", "rows": "int64 N"}
    frames: Tensor
    """int64 [N, W], their hypervectors."""
    rows: Tensor
    """int64 [N] (CPU), their classes."""
    n_classes: int

    def check(self) -> None:
        if self.rows.min() < 0 or self.rows.max() >= self.n_classes:
            raise ValueError(f"rows: expected classes in [0, {self.n_classes})")


class Neighbours(Updatable):
    """The class of most of the k nearest training frames in Hamming distance.

    Among equally near frames, the first class comes first, so the order of training has no effect.
    Among classes with equally many votes, the class with the nearest frame wins.

    Args:
        n_neighbors: k.
    """

    State = Kept
    needs = ("frames",)
    adapts_by = ()
    renamed: ClassVar = {"n_neighbours": "n_neighbors"}

    def __init__(self, n_neighbors: int = 1):
        self.n_neighbors = n_neighbors

    def check(self) -> None:
        check_integer("n_neighbors", self.n_neighbors, 1)

    def empty(self, n_classes: int, dimension: int, device: torch.device | str) -> Kept:
        shape = 0, bits.words_for(dimension)
        return Kept(
            frames=torch.empty(shape, dtype=torch.int64, device=device),
            rows=torch.empty(0, dtype=torch.int64),
            n_classes=n_classes,
        )

    def add(self, state: Kept, batches: Iterable[tuple[Hypervectors, Tensor]]) -> Kept:
        frames, rows = [state.frames], [state.rows]
        for words, of_words in batches:
            frames.append(words.packed)
            rows.append(of_words)
        return replace(state, frames=torch.cat(frames), rows=torch.cat(rows))

    def arrange(self, state: Kept, places: Sequence[int], n_classes: int) -> Kept:
        new_row = torch.tensor(list(places), dtype=torch.int64)
        return replace(state, rows=new_row[state.rows], n_classes=n_classes)

    def adapt(self, state: Kept, words: Hypervectors, rows: Tensor) -> Kept:
        """Replace the stored hypervectors of the new hypervectors' classes."""
        others = ~torch.isin(state.rows, rows)
        kept = state.frames[others.to(state.frames.device)]
        frames = torch.cat((kept, words.packed))
        return replace(state, frames=frames, rows=torch.cat((state.rows[others], rows)))

    def scores(self, state: Kept, words: Hypervectors) -> Tensor:
        """Minus the distance to the nearest frame of each class, plus a large bonus for votes.

        int64 [Q, L]; the distance to a class without frames is D + 1.
        """
        distances = bits.hamming(words.packed, state.frames)
        return self._scores_at(distances, state, words.dimension)

    def held_out(
        self, state: Kept, words: Hypervectors | None, rows: Tensor
    ) -> HeldOut:
        """The scores without one equal training frame of the same class."""
        assert words is not None
        distances = bits.hamming(words.packed, state.frames)
        own = state.rows == rows[:, None]
        equal = own.to(distances.device) & (distances == 0)
        places = equal.any(1).nonzero().flatten()
        first = equal[places].int().argmax(1)
        distances[places, first] = words.dimension + 1
        scores = self._scores_at(distances, state, words.dimension)
        return HeldOut(scores.double().cpu(), rows)

    def _scores_at(self, distances: Tensor, state: Kept, dimension: int) -> Tensor:
        """Scores int64 [Q, L] from distances int64 [Q, N] to the training frames of D bits."""
        n_classes = state.n_classes
        rows = state.rows.to(distances.device).expand_as(distances)
        far = dimension + 1
        farthest = distances.new_full((len(distances), n_classes), far)
        scores = -farthest.scatter_reduce(1, rows, distances, "amin")
        if self.n_neighbors > 1:
            by_distance_and_class = distances * n_classes + rows
            k = min(self.n_neighbors, len(state.frames))
            nearest = by_distance_and_class.topk(k, dim=1, largest=False)
            voting = nearest.values % n_classes
            is_there = nearest.values // n_classes <= dimension
            votes = torch.zeros_like(scores)
            votes.scatter_add_(1, voting, is_there.to(votes.dtype))
            scores += (far + 1) * votes
        return scores
