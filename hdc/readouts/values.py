"""Base class of read-outs of numbers, and the mean of the nearest frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.parameters import Part, check_integer
from hdc.readouts.base import State
from hdc.tensors import Kinds, checked

RESIDUALS: Kinds = {"residuals": "float64 N L"}
_ROWS = 256  # frames that are compared with all others at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class ValueState(State):
    """The immutable state of a trained read-out of numbers."""

    words: Hypervectors
    """Hypervectors of the N training frames."""
    targets: Tensor
    """float64 [N, T], the numbers of the training frames."""
    residuals: Tensor | None = None
    """Leave-one-out errors float64 [N, T]; None for a read-out without intervals."""

    def tensors(self) -> dict[str, Tensor]:
        """The tensors for a file, without the frames and numbers of training."""
        found = super().tensors()
        del found["targets"]
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class LeftOut(ValueState):
    """A state with leave-one-out errors only."""

    kinds: ClassVar[Kinds] = RESIDUALS


class ValueReadout(Part, ABC):
    """Base class of read-outs of numbers: T numbers per frame from packed hypervectors.

    A subclass implements :meth:`fit` and :meth:`values`; for intervals also :meth:`without`, with
    `residuals` in its states. It sets `State` if its states have other tensors.
    """

    State: ClassVar[Any] = ValueState

    @abstractmethod
    def fit(self, words: Hypervectors, values: Tensor) -> Any:
        """Learn from N hypervectors and values float64 [N, T], and return a state."""

    @abstractmethod
    def values(self, state: Any, words: Hypervectors) -> Tensor:
        """Numbers float64 [Q, T] (CPU) of Q hypervectors."""

    def adapt(self, state: Any, words: Hypervectors, values: Tensor) -> Any:
        """The state for new frames; by default it is trained on these alone."""
        return self.fit(words, values)

    def without(self, state: Any, words: Hypervectors) -> tuple[Tensor, Tensor]:
        """:meth:`values`, and the predictions without each training frame, [Q, N, T].

        Raises:
            ValueError: for a read-out without such predictions.
        """
        raise ValueError(
            f"interval: {type(self).__name__} has no leave-one-out predictions"
        )

    def restored(
        self, tensors: Mapping[str, Tensor], words: Hypervectors, values: Tensor
    ) -> Any:
        """The state from the tensors of a file and the hypervectors and numbers of training."""
        n, n_targets = values.shape
        if self.State.kinds:
            sizes = {"N": n, "L": n_targets, "D": words.dimension}
            tensors = checked(tensors, self.State.kinds, **sizes)
        return self.State(words=words, targets=values, **tensors)


class NeighbourValues(ValueReadout):
    """The mean of the k nearest training frames in Hamming distance.

    Equally near frames come in the order of training.

    Args:
        n_neighbors: k.
    """

    State = LeftOut
    renamed: ClassVar = {"n_neighbours": "n_neighbors"}

    def __init__(self, n_neighbors: int = 1):
        self.n_neighbors = n_neighbors

    def check(self) -> None:
        check_integer("n_neighbors", self.n_neighbors, 1)

    def fit(self, words: Hypervectors, values: Tensor) -> ValueState:
        """See :meth:`ValueReadout.fit`.

        Raises:
            ValueError: for as many neighbours as training frames, or more.
        """
        k = self.n_neighbors
        if k >= len(words):
            raise ValueError(
                f"n_neighbors: expected fewer than the {len(words)} training frames, found {k}"
            )
        means = []
        for start in range(0, len(words), _ROWS):  # not all pairs at a time
            distances = _distances(words[start : start + _ROWS], words)
            own = np.arange(len(distances))
            # A frame is not its own neighbour.
            distances[own, start + own] = words.dimension + 1
            means.append(values[self._nearest(distances)[:, :k]].mean(1))
        residuals = values - torch.cat(means)
        return LeftOut(words=words, targets=values, residuals=residuals)

    def values(self, state: ValueState, words: Hypervectors) -> Tensor:
        distances = _distances(words, state.words)
        places = self._nearest(distances)[:, : self.n_neighbors]
        return state.targets[places].mean(1)

    def without(self, state: ValueState, words: Hypervectors) -> tuple[Tensor, Tensor]:
        k = self.n_neighbors
        places = self._nearest(_distances(words, state.words))
        values = state.targets[places]  # [Q, k + 1, T]
        means = values[:, :k].mean(1)
        without = means[:, None].repeat(1, len(state.words), 1)
        queries = torch.arange(len(words))[:, None]
        # Without one of the k nearest, the next one is in its place.
        moved = (values[:, k:] - values[:, :k]) / k
        without[queries, places[:, :k]] += moved
        return means, without

    def _nearest(self, distances: np.ndarray) -> Tensor:
        """The k nearest frames of each query and the next one, [Q, k + 1]."""
        order = distances.argsort(axis=1, kind="stable")
        return torch.from_numpy(order[:, : self.n_neighbors + 1])


def _distances(words: Hypervectors, known: Hypervectors) -> np.ndarray:
    """Hamming distances int64 [Q, N] to the training frames."""
    return bits.hamming(words.packed, known.packed).cpu().numpy()
