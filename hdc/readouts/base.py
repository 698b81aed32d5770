"""The base classes of read-outs, which score classes, and of what they learn."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, Self

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.parameters import Parametrised
from hdc.tensors import Kinds, checked, compact

NOWHERE = torch.iinfo(torch.int64).min
"""Score of a class without samples, in whole numbers."""


class HeldOut(NamedTuple):
    """Scores of training frames as if each of them had not been learnt, and their classes."""

    scores: Tensor  # float64 [m, L] (CPU), in the unit of Readout.scores
    rows: Tensor  # int64 [m] (CPU)


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """What a read-out has learned: tensors that nobody changes, int64 or float64."""

    kinds: ClassVar[Kinds] = {}
    """Types and axes of the tensors in a file, of :mod:`hdc.tensors`; by default any.

    One that is None by default may be missing. A state may also have the fields `n_classes` and
    `dimension`.
    """
    held_out: HeldOut | None = None
    """Scores of left-out training frames, where training finds them."""

    def check(self) -> None:
        """Raise ValueError for tensors of a file that do not fit together."""

    def tensors(self) -> dict[str, Tensor]:
        """The tensors of a file."""
        names = [field.name for field in fields(self)]
        found = {name: getattr(self, name) for name in names}
        return {name: x for name, x in found.items() if isinstance(x, Tensor)}

    def __getstate__(self) -> dict[str, Any]:
        """Tensors without the rest of the memory that they are views of."""
        found = {field.name: getattr(self, field.name) for field in fields(self)}
        return found | {name: compact(x) for name, x in self.tensors().items()}

    def to(self, device: torch.device | str) -> Self:
        """The same with its hypervectors in the memory of a device."""
        moved: dict[str, Any] = {}
        for name, tensor in self.tensors().items():
            if "W" in self.kinds.get(name, "W").split():
                moved[name] = tensor.to(device)
        return replace(self, **moved)


class Readout(Parametrised, ABC):
    """Scores of classes from packed hypervectors; an idea is a subclass in a file of its own.

    A subclass names its kind of `State`, and writes :meth:`fit` and :meth:`scores`. Classes are
    rows 0 … L − 1; which labels they have is the model's business. One that can follow a drift also
    has a method ``adapt(state, words, rows, p, random_state, method)``, which returns a state for
    new hypervectors of known classes. It is given those arguments of
    :meth:`hdc.HDCClassifier.recalibrate` that `adapts_by` names.

    Example:
        >>> import torch
        >>> from dataclasses import dataclass
        >>> from hdc import HDCClassifier, bits
        >>> @dataclass(frozen=True, kw_only=True, eq=False)
        ... class Firsts(State):
        ...     first: Tensor
        >>> class First(Readout):
        ...     State = Firsts
        ...     def fit(self, words, rows, n_classes):
        ...         packed = [words.packed[rows == c][0] for c in range(n_classes)]
        ...         return Firsts(first=torch.stack(packed))
        ...     def scores(self, state, words):
        ...         return -bits.hamming(words.packed, state.first)
        >>> frames = torch.tensor([[9, 8, 1, 0], [0, 1, 9, 8]], dtype=torch.uint8)
        >>> HDCClassifier(readout=First()).fit(frames, ["a", "b"]).predict(frames).tolist()
        ['a', 'b']
    """

    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the scores of some query."""
    State: ClassVar[Any]
    """The class of its states."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Names of the tensors that a prediction needs; by default all of a state."""
    adapts_by: ClassVar[tuple[str, ...]] = ("p", "random_state", "method")
    """Arguments of :meth:`hdc.HDCClassifier.recalibrate` that ``adapt`` is given."""

    def check(self) -> None:
        """Raise ValueError, naming it, for a parameter that is not allowed."""

    @abstractmethod
    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Any:
        """Learn.

        Args:
            words: N hypervectors.
            rows: their classes int64 [N] (CPU), in [0, L).
            n_classes: L; a class without samples is never to be the best.
        """

    @abstractmethod
    def scores(self, state: Any, words: Hypervectors) -> Tensor:
        """A score for each class, the largest wins, the first of equal ones: [Q, L]."""

    def held_out(
        self, state: Any, words: Hypervectors | None, rows: Tensor
    ) -> HeldOut | None:
        """Scores of training frames as if each had not been learnt, where they have a closed form.

        Args:
            state: what was learned.
            words: some of the training frames, of a read-out that goes on learning.
            rows: their classes int64 [m] (CPU).

        Returns:
            For these, or for others that were kept in training; None without a closed form.
        """
        found: HeldOut | None = state.held_out
        return found

    def needed(self, state: Any) -> dict[str, Tensor]:
        """The tensors that a prediction needs; they share memory with the state."""
        tensors = state.tensors()
        return {name: tensors[name] for name in self.needs or tensors}

    def restored(
        self, tensors: Mapping[str, Tensor], n_classes: int, dimension: int
    ) -> Any:
        """The state of the tensors of a file.

        Raises:
            ValueError: for tensors that do not fit.
        """
        known = {field.name: field.default for field in fields(self.State)}
        kinds = dict(self.State.kinds)
        for name in kinds.keys() - tensors.keys():
            if known[name] is None:
                del kinds[name]
        if kinds:
            tensors = checked(tensors, kinds, L=n_classes, D=dimension)
        sizes = {"n_classes": n_classes, "dimension": dimension}
        own = {name: size for name, size in sizes.items() if name in known}
        state = self.State(**tensors, **own)
        state.check()
        return state


class Updatable(Readout):
    """A read-out that goes on learning, batch by batch, and new classes on the way."""

    held_out: Any = None
    """A method as of :class:`Readout`, of a read-out that scores left-out frames of a sample."""

    @abstractmethod
    def empty(self, n_classes: int, dimension: int, device: torch.device | str) -> Any:
        """The state before the first hypervector."""

    @abstractmethod
    def add(self, state: Any, batches: Iterable[tuple[Hypervectors, Tensor]]) -> Any:
        """The state after further batches: hypervectors, and their classes int64 [N]."""

    @abstractmethod
    def arrange(self, state: Any, places: Sequence[int], n_classes: int) -> Any:
        """The state with room for new classes: class k becomes class places[k] of n_classes."""

    @abstractmethod
    def merge(self, state: Any, other: Any, places: Sequence[int]) -> Any:
        """The state of both trainings; class k of the other is class places[k] here."""

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Any:
        start = self.empty(n_classes, words.dimension, words.packed.device)
        return self.add(start, [(words, rows)])


def without_empty(scores: Tensor, empty: Tensor) -> Tensor:
    """Scores [Q, L] in which classes without samples, bool [L], never win."""
    if empty.any():
        lowest = NOWHERE if not scores.is_floating_point() else -torch.inf
        scores[:, empty.to(scores.device)] = lowest
    return scores
