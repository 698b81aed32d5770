"""Nearest neighbours: every training frame is kept, as bits or as grey values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines import dual
from baselines.base import Classifier, FrameSource, choose
from baselines.dual import Moments, Products
from hdc import bits
from hdc.encode import encode

PIXELS = (
    "bits",
    "raw",
    "standardised",
)  # any other scaling of baselines.pixels ranks as raw does
REPORT = 100  # frames between two yields


@dataclass(kw_only=True, eq=False)
class NearestNeighbour(Classifier):
    """The most frequent label among the k nearest training frames; among equals the nearest's.

    Args:
        k: number of neighbours.
        pixels: ``bits``: Hamming distance of hypervectors, as HDC encodes frames; ``raw``:
            Euclidean distance of grey values; ``standardised``: of frames that have each mean 0 and
            deviation 1.

    Attributes:
        frames_: the training frames: hypervectors int64 [N, ⌈D/64⌉], or pixels [N, D].
        labels_: int64 [N], their class indices.
    """

    k: int = 1
    pixels: str = "bits"

    prediction_batch: ClassVar[int] = 500  # each batch reads all training frames once

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """One pass; yields samples_seen every :data:`REPORT` frames."""
        choose("pixels", self.pixels, PIXELS)
        if self.k < 1:
            raise ValueError(f"k: expected an integer from 1, found {self.k}")
        targets = self.start(frames, labels)
        kept = None
        for first in range(0, len(frames), REPORT):
            batch = self.read(frames, slice(first, first + REPORT)).flatten(1)
            batch = encode(batch) if self.pixels == "bits" else batch
            if kept is None:
                kept = batch.new_empty(len(frames), batch.shape[1])
            last = first + len(batch)
            kept[first:last] = batch
            self.frames_, self.labels_ = kept[:last], targets[:last]
            if self.pixels != "bits":
                self._moments = dual.moments(self.frames_)
            yield {"samples_seen": last}

    def scores(self, batch: Tensor) -> Tensor:
        """Votes of the nearest training frames, float64 [n, L]."""
        if self.pixels == "bits":
            distances = bits.hamming(encode(batch), self.frames_)
        else:
            images = batch.flatten(1)
            greys, moments = (
                dual.cross_products(images, self.frames_),
                dual.moments(images),
            )
            distances = self._distances(greys, moments, self._moments, images.shape[1])
        return self._votes(distances, self.labels_, len(self.classes_))

    def scores_from(
        self, products: Products, train: np.ndarray, queries: np.ndarray
    ) -> Tensor:
        """See :meth:`baselines.dual.Products.scores`."""
        if self.pixels == "bits":
            distances = -products.bits[np.ix_(queries, train)]  # D − 2·Hamming distance
        else:
            greys = products.greys[np.ix_(queries, train)]
            moments, known = products.moments(queries), products.moments(train)
            distances = self._distances(greys, moments, known, products.dimension)
        return self._votes(distances, products.labels[train], products.n_classes)

    def state_tensors(self) -> dict[str, Tensor]:
        """frames and labels [N]."""
        return {"frames": self.frames_, "labels": self.labels_}

    def _distances(
        self, products: Tensor, rows: Moments, columns: Moments, dimension: int
    ) -> Tensor:
        """Squared distances [n, N] from products and moments of greys, but for a constant a row."""
        if self.pixels == "raw":
            return columns[1] - 2 * products
        first, second = columns
        squares = (second - first**2 / dimension) / dual.deviations(
            *columns, dimension
        ) ** 2
        # Squares are D, and 0 for a constant frame.
        return squares - 2 * dual.standardised(products, rows, columns, dimension)

    def _votes(self, distances: Tensor, labels: Tensor, n_classes: int) -> Tensor:
        k = min(self.k, len(labels))
        nearest = labels[distances.argsort(dim=1, stable=True)[:, :k]]
        # All that is added to the votes is less than one vote, and the nearest's is the most.
        weights = 1 + 0.5 ** torch.arange(
            1, k + 1, dtype=torch.float64, device=labels.device
        )
        return (F.one_hot(nearest, n_classes) * weights[:, None]).sum(dim=1)
