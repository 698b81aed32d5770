"""Nearest training frames; all hypervectors are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Self

import torch
from torch import Tensor

from hdc import bits
from hdc.parameters import check_integer
from hdc.readouts.base import HeldOut, Updatable


class Neighbours(Updatable):
    """The class of most of the k nearest training frames in Hamming distance.

    The first class comes first among equally near frames, so the order of training decides
    nothing; of classes with as many votes the one with the nearest frame wins.

    Args:
        n_neighbours: k.

    Attributes:
        frames_: int64 [N, W], the hypervectors of all training frames.
        rows_: int64 [N] (CPU), their classes.
    """

    frames_: Tensor
    rows_: Tensor
    kept: ClassVar = {"frames": "int64 N W", "rows": "int64 N"}
    predicts = ("frames",)
    adapts_by = ()
    _n_classes: int

    def __init__(self, n_neighbours: int = 1):
        self.n_neighbours = n_neighbours

    def check(self) -> None:
        check_integer("n_neighbours", self.n_neighbours, 1)

    def fit(self, words: Tensor, rows: Tensor, n_classes: int, dimension: int) -> Self:
        self._n_classes = n_classes
        self._dimension = dimension
        self.frames_ = words.clone()
        self.rows_ = rows
        return self

    def add(self, words: Tensor, rows: Tensor) -> None:
        self.frames_ = torch.cat((self.frames_, words))
        self.rows_ = torch.cat((self.rows_, rows))

    def arrange(self, places: Sequence[int], n_classes: int) -> None:
        self._n_classes = n_classes
        new_row = torch.tensor(list(places), dtype=torch.int64)
        self.rows_ = new_row[self.rows_]

    def merge(self, other: Self, places: Sequence[int]) -> None:
        new_row = torch.tensor(list(places), dtype=torch.int64)
        self.add(other.frames_, new_row[other.rows_])

    def adapt(self, words: Tensor, rows: Tensor) -> None:
        """Take the new hypervectors in place of the kept ones of their classes."""
        others = ~torch.isin(self.rows_, rows)
        kept = self.frames_[others.to(self.frames_.device)]
        self.frames_ = torch.cat((kept, words))
        self.rows_ = torch.cat((self.rows_[others], rows))

    def scores(self, words: Tensor) -> Tensor:
        """Minus the distance of the nearest frame of each class, and far more for one with votes.

        int64 [Q, L]; a class without frames is one farther than the farthest.
        """
        return self._scores_at(bits.hamming(words, self.frames_, self.backend))

    def held_out(self, words: Tensor, rows: Tensor) -> HeldOut:
        """The scores with all training frames but one that is equal and of the same class."""
        distances = bits.hamming(words, self.frames_, self.backend)
        own = self.rows_ == rows[:, None]
        equal = own.to(distances.device) & (distances == 0)
        places = equal.any(1).nonzero().flatten()
        first = equal[places].int().argmax(1)
        distances[places, first] = self._dimension + 1
        return HeldOut(self._scores_at(distances).double().cpu(), rows)

    def _scores_at(self, distances: Tensor) -> Tensor:
        """Scores int64 [Q, L] at distances int64 [Q, N] from the training frames."""
        rows = self.rows_.to(distances.device).expand_as(distances)
        far = self._dimension + 1
        farthest = distances.new_full((len(distances), self._n_classes), far)
        scores = -farthest.scatter_reduce(1, rows, distances, "amin")
        if self.n_neighbours > 1:
            by_distance_and_class = distances * self._n_classes + rows
            k = min(self.n_neighbours, len(self.frames_))
            nearest = by_distance_and_class.topk(k, dim=1, largest=False)
            voting = nearest.values % self._n_classes
            is_there = nearest.values // self._n_classes <= self._dimension
            votes = torch.zeros_like(scores)
            votes.scatter_add_(1, voting, is_there.to(votes.dtype))
            scores += (far + 1) * votes
        return scores

    def restore(
        self, tensors: Mapping[str, Tensor], n_classes: int, dimension: int
    ) -> None:
        super().restore(tensors, n_classes, dimension)
        if self.rows_.min() < 0 or self.rows_.max() >= n_classes:
            raise ValueError(f"rows: expected classes in [0, {n_classes})")
        self._n_classes = n_classes
