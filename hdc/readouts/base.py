"""The base class of read-outs: hypervectors of known classes to scores of queries."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple, Protocol, Self, TypeVar

import torch
from torch import Tensor

from hdc.parameters import Parametrised
from hdc.tensors import Kinds, take, tensors_of

NOWHERE = torch.iinfo(torch.int64).min
"""Score of a class without samples, in whole numbers."""


class HeldOut(NamedTuple):
    """Scores of training frames as if each of them had not been learnt, and their classes."""

    scores: Tensor  # float64 [m, L] (CPU), in the unit of Readout.scores
    rows: Tensor  # int64 [m] (CPU)


class Readout(Parametrised, ABC):
    """Scores of classes from packed hypervectors; an idea is a subclass in a file of its own.

    A subclass writes :meth:`fit` and :meth:`scores`. Learned tensors are int64 or float64, in
    attributes that end in an underscore: they are what is saved, sized and flipped, unless it
    writes :meth:`state` and :meth:`restore`. Classes are rows 0 … L − 1; which labels they have is
    the model's business. One that can follow a drift also has a method ``adapt(words, rows, p,
    seed, method)``, which is given new hypervectors of known classes and those arguments of
    :meth:`hdc.HDCClassifier.recalibrate` that `adapts_by` names; it changes no tensor in place, and
    may return the factor by which the scores of classes without new frames change.

    Example:
        >>> import torch
        >>> from hdc import HDCClassifier, bits
        >>> class First(Readout):
        ...     def fit(self, words, rows, n_classes, dimension):
        ...         self.first_ = torch.stack([words[rows == c][0] for c in range(n_classes)])
        ...         return self
        ...     def scores(self, words):
        ...         return -bits.hamming(words, self.first_)
        >>> frames = torch.tensor([[9, 8, 1, 0], [0, 1, 9, 8]], dtype=torch.uint8)
        >>> HDCClassifier(readout=First()).fit(frames, ["a", "b"]).predict(frames).tolist()
        ['a', 'b']
    """

    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the scores of some query."""
    backend: str = "numpy"
    """Set by the model: ``"numpy"`` or ``"compiled"``, for :func:`hdc.bits.hamming` and others."""
    kept: ClassVar[Kinds] = {}
    """The tensors of a file, of :mod:`hdc.tensors`; by default all that are learned."""
    predicts: ClassVar[tuple[str, ...]] = ()
    """Those of them that :meth:`state` has; by default all."""
    adapts_by: ClassVar[tuple[str, ...]] = ("p", "seed", "method")
    """Arguments of :meth:`hdc.HDCClassifier.recalibrate` that ``adapt`` is given."""
    _dimension: int

    def check(self) -> None:
        """Raise ValueError, naming it, for a parameter that is not allowed."""

    @abstractmethod
    def fit(self, words: Tensor, rows: Tensor, n_classes: int, dimension: int) -> Self:
        """Start anew and learn.

        Args:
            words: hypervectors int64 [N, ⌈D/64⌉].
            rows: their classes int64 [N] (CPU), in [0, L).
            n_classes: L; a class without samples is never to be the best.
            dimension: D, bits of a hypervector.
        """

    @abstractmethod
    def scores(self, words: Tensor) -> Tensor:
        """A score for each class, the largest wins, the first of equal ones: [Q, W] → [Q, L]."""

    def held_out(self, words: Tensor, rows: Tensor) -> HeldOut | None:
        """Scores of training frames as if each had not been learnt, where they have a closed form.

        Args:
            words: hypervectors int64 [m, W] of some of the training frames.
            rows: their classes int64 [m] (CPU).

        Returns:
            For these, or for others that were kept in training; None without a closed form.
        """
        return None

    def state(self) -> dict[str, Tensor]:
        """The tensors that a prediction needs; they share memory with the read-out."""
        stored = self.stored()
        return {name: stored[name] for name in self.predicts or stored}

    def stored(self) -> dict[str, Tensor]:
        """The tensors of a file: :meth:`state`, and what further training needs."""
        return tensors_of(self, self.kept) if self.kept else learned_tensors(self)

    def restore(
        self, tensors: Mapping[str, Tensor], n_classes: int, dimension: int
    ) -> None:
        """Learn :meth:`stored` of a file.

        Raises:
            ValueError: for tensors that do not fit.
        """
        self._dimension = dimension
        if self.kept:
            take(self, tensors, self.kept, L=n_classes, D=dimension)
        else:
            vars(self).update(tensors)


class Whole(Readout):
    """A read-out that learns all frames at once, and keeps their scores without themselves.

    They are in no file.
    """

    _held_out: HeldOut | None = None

    def held_out(self, words: Tensor, rows: Tensor) -> HeldOut | None:
        """Scores of frames of the last training, in closed form; None once loaded."""
        return self._held_out


class Updatable(Readout):
    """A read-out that goes on learning, batch by batch, and new classes on the way."""

    @abstractmethod
    def add(self, words: Tensor, rows: Tensor) -> None:
        """Learn further hypervectors int64 [N, W] of classes rows int64 [N]."""

    def settle(self) -> None:
        """Called once after several :meth:`add`, before scores are asked for."""

    @abstractmethod
    def arrange(self, places: Sequence[int], n_classes: int) -> None:
        """Make room for new classes: class k becomes class places[k] of n_classes."""

    @abstractmethod
    def merge(self, other: Self, places: Sequence[int]) -> None:
        """Learn what another one has learned, whose class k is class places[k] here."""


Part = TypeVar("Part", bound="HasBackend")


class HasBackend(Protocol):
    """A read-out of classes or of numbers."""

    backend: str


def with_backend(readout: Part, backend: str) -> Part:
    """A read-out that computes by this backend: itself, or a copy that shares all it has learned.

    Nothing of a read-out that several threads may be asking is changed.
    """
    if readout.backend == backend:
        return readout
    changed = copy.copy(readout)
    changed.backend = backend
    return changed


def learned_tensors(readout: object) -> dict[str, Tensor]:
    """The tensors among the attributes that end in an underscore."""
    return {
        name: value
        for name, value in vars(readout).items()
        if name.endswith("_") and isinstance(value, Tensor)
    }


def without_empty(scores: Tensor, empty: Tensor) -> Tensor:
    """Scores [Q, L] in which classes without samples, bool [L], never win."""
    if empty.any():
        lowest = NOWHERE if not scores.is_floating_point() else -torch.inf
        scores[:, empty.to(scores.device)] = lowest
    return scores
