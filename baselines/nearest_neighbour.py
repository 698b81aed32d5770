"""Nearest neighbours: the grey values of every training frame are kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from torch import Tensor
from torch.nn import functional as F

from baselines import products
from baselines.bank import Bank
from baselines.base import Classifier, FrameSource

REPORT = 100  # frames between two yields


@dataclass(kw_only=True, eq=False)
class NearestNeighbour(Classifier):
    """The most frequent label among the k training frames of least Euclidean distance; of equally
    frequent ones the label of the nearest frame.

    Training frames of the first class are nearer at equal distances.

    Args:
        k: number of neighbours.

    Attributes:
        frames_: pixels of the training frames [N, D].
        labels_: int64 [N], their class indices.
    """

    k: int = 1

    revision: ClassVar[int] = 1
    prediction_batch: ClassVar[int] = 500  # each batch reads all training frames once

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """One pass; yields samples_seen every :data:`REPORT` frames."""
        self.check()
        targets = self.start(frames, labels)
        kept = None
        for first in range(0, len(frames), REPORT):
            batch = self.read(frames, slice(first, first + REPORT))
            batch = batch.flatten(1)
            if kept is None:
                kept = batch.new_empty(len(frames), batch.shape[1])
            last = first + len(batch)
            kept[first:last] = batch
            self.frames_, self.labels_ = kept[:last], targets[:last]
            self._squares = products.moments(self.frames_).second
            yield {"samples_seen": last}

    def check(self) -> None:
        """Raise ValueError for a parameter that is wrong."""
        if self.k < 1:
            raise ValueError(f"k: expected an integer from 1, found {self.k}")

    def scores(self, batch: Tensor) -> Tensor:
        """Votes of the nearest training frames, int64 [n, L]; see :meth:`_votes`."""
        greys = products.cross_products(batch.flatten(1), self.frames_)
        distances = self._squares - 2 * greys  # squares, up to a constant per row
        return self._votes(distances, self.labels_, len(self.classes_))

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        model = replace(self)
        model.check()
        targets = model.start(bank.at(train), bank.labels[train])
        greys = bank.greys[np.ix_(queries, train)]
        distances = bank.moments.of(train).second - 2 * greys
        votes = self._votes(distances, targets, len(model.classes_))
        return model.classes_[votes.argmax(1).numpy(force=True)]

    def state_tensors(self) -> dict[str, Tensor]:
        """frames and labels [N]."""
        return {"frames": self.frames_, "labels": self.labels_}

    def _votes(
        self,
        distances: Tensor,
        labels: Tensor,
        n_classes: int,
    ) -> Tensor:
        """Votes [n, L]; of classes with equally many votes, the class of the nearest frame gets the
        largest number."""
        k = min(self.k, len(labels))
        by_class = labels.argsort(stable=True)
        order = distances[:, by_class].argsort(dim=1, stable=True)
        of_nearest = labels[by_class][order[:, :k]]
        nearest = F.one_hot(of_nearest, n_classes)
        first = nearest.argmax(dim=1)  # place of the nearest of each class; 0: or none
        return (k + 1) * nearest.sum(dim=1) - first
