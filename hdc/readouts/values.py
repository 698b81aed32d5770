"""The base class of read-outs of numbers, and the mean of the nearest frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.parameters import Parametrised, check_integer
from hdc.readouts.base import learned_tensors
from hdc.tensors import take, tensors_of

RESIDUALS = {"residuals": "float64 N T"}
_ROWS = 256  # frames that are compared with all others at a time


class ValueReadout(Parametrised, ABC):
    """T numbers per frame from packed hypervectors; an idea is a subclass in a file of its own.

    A subclass writes :meth:`fit` and :meth:`values`; for intervals also :meth:`without` and
    `residuals_`. Learned tensors are attributes that end in an underscore.
    """

    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the numbers of some query."""
    backend: str = "numpy"
    _dimension: int
    residuals_: Tensor
    """Leave-one-out errors of the training frames, float64 [N, T]."""

    def check(self) -> None:
        """Raise ValueError, naming it, for a parameter that is not allowed."""

    @abstractmethod
    def fit(self, words: Tensor, values: Tensor, dimension: int) -> Self:
        """Start anew and learn float64 values [N, T] of hypervectors int64 [N, W] of D bits."""

    @abstractmethod
    def values(self, words: Tensor) -> Tensor:
        """Numbers float64 [Q, T] (CPU) of hypervectors int64 [Q, W]."""

    def adapt(self, words: Tensor, values: Tensor) -> Self:
        """Go to new frames; by default those alone are learned."""
        return self.fit(words, values, self._dimension)

    def without(self, words: Tensor) -> tuple[Tensor, Tensor]:
        """:meth:`values`, and those without each training frame, [Q, N, T].

        Raises:
            ValueError: for a read-out that has none.
        """
        raise ValueError(
            f"interval: {type(self).__name__} has no leave-one-out predictions"
        )

    def stored(self) -> dict[str, Tensor]:
        """The tensors of a file, besides the frames and values of training."""
        return learned_tensors(self)

    def restore(
        self,
        tensors: Mapping[str, Tensor],
        words: Tensor,
        values: Tensor,
        dimension: int,
    ) -> None:
        """Learn :meth:`stored` of a file, and the hypervectors and values of training."""
        self._dimension = dimension
        for name, tensor in tensors.items():
            setattr(self, name, tensor)


class NeighbourValues(ValueReadout):
    """The mean of the k nearest training frames in Hamming distance.

    Of equally near frames those that were learnt first come first.

    Args:
        n_neighbours: k.
    """

    _words: Tensor
    _targets: Tensor

    def __init__(self, n_neighbours: int = 1):
        self.n_neighbours = n_neighbours

    def check(self) -> None:
        check_integer("n_neighbours", self.n_neighbours, 1)

    def fit(self, words: Tensor, values: Tensor, dimension: int) -> Self:
        self._words = words
        self._targets = values
        self._dimension = dimension
        k = min(self.n_neighbours, max(1, len(words) - 1))
        means = []
        for start in range(0, len(words), _ROWS):  # not all pairs at a time
            distances = self._distances(words[start : start + _ROWS])
            own = np.arange(len(distances))
            distances[own, start + own] = dimension + 1  # none is its own neighbour
            means.append(values[self._nearest(distances)[:, :k]].mean(1))
        self.residuals_ = values - torch.cat(means)
        return self

    def values(self, words: Tensor) -> Tensor:
        places = self._nearest(self._distances(words))[:, : self.n_neighbours]
        return self._targets[places].mean(1)

    def without(self, words: Tensor) -> tuple[Tensor, Tensor]:
        n = len(self._words)
        if self.n_neighbours >= n:  # all are near
            total = self._targets.sum(0)
            others = (total - self._targets) / max(1, n - 1)
            means = (total / n).repeat(len(words), 1)
            return means, others.repeat(len(words), 1, 1)
        places = self._nearest(self._distances(words))
        values = self._targets[places]  # [Q, k + 1, T]
        k = values.shape[1] - 1
        means = values[:, :k].mean(1)
        without = means[:, None].repeat(1, len(self._words), 1)
        queries = torch.arange(len(words))[:, None]
        # Without one of the k nearest, the next one is in its place.
        moved = (values[:, k:] - values[:, :k]) / k
        without[queries, places[:, :k]] += moved
        return means, without

    def _distances(self, words: Tensor) -> np.ndarray:
        """Hamming distances int64 [Q, N] to the training frames."""
        return bits.hamming(words, self._words, self.backend).cpu().numpy()

    def _nearest(self, distances: np.ndarray) -> Tensor:
        """The k nearest frames of each query and the next one, [Q, k + 1], or all N."""
        order = distances.argsort(axis=1, kind="stable")
        return torch.from_numpy(order[:, : self.n_neighbours + 1])

    def stored(self) -> dict[str, Tensor]:
        return tensors_of(self, RESIDUALS)

    def restore(
        self,
        tensors: Mapping[str, Tensor],
        words: Tensor,
        values: Tensor,
        dimension: int,
    ) -> None:
        n, n_targets = values.shape
        take(self, tensors, RESIDUALS, N=n, T=n_targets)
        self._words = words
        self._targets = values
        self._dimension = dimension
