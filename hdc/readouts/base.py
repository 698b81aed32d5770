"""Base classes of read-outs, which score classes, and of their states."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.parameters import Part
from hdc.tensors import Kinds, checked


class HeldOut(NamedTuple):
    """Scores of left-out training frames, and their classes."""

    scores: Tensor  # float64 [m, L] (CPU), in the units of Readout.scores
    rows: Tensor  # int64 [m] (CPU)


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """The state of a trained read-out: tensors, int64 or float64, that are never changed."""

    kinds: ClassVar[Kinds] = {}
    """Types and axes of the tensors in a file (:mod:`hdc.tensors`); by default any.

    A tensor whose default is None may be missing. A state may also have the fields `n_classes` and
    `dimension`.
    """
    held_out: HeldOut | None = None
    """Scores of left-out training frames, if training gives them."""

    def check(self) -> None:
        """Raise ValueError for tensors from a file that do not fit together."""

    def tensors(self) -> dict[str, Tensor]:
        """The tensors for a file."""
        names = [field.name for field in fields(self)]
        found = {name: getattr(self, name) for name in names}
        return {name: x for name, x in found.items() if isinstance(x, Tensor)}


class Readout(Part, ABC):
    """Base class of read-outs: class scores from packed hypervectors.

    A subclass sets the class of its `State`, and implements :meth:`fit` and :meth:`scores`. Classes
    are rows 0 … L − 1; the model maps them to labels. A read-out that can follow a drift also has a
    method ``adapt(state, words, rows, p, random_state, method)``, which returns a state that is
    adapted to new hypervectors of known classes. Its last arguments are the arguments of
    :meth:`hdc.HDCClassifier.recalibrate` that are named in `adapts_by`.

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

    State: ClassVar[Any]
    """The class of its states."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Names of the tensors that a prediction needs; by default all of the state."""
    adapts_by: ClassVar[tuple[str, ...]] = ("p", "random_state", "method")
    """Arguments of :meth:`hdc.HDCClassifier.recalibrate` that ``adapt`` takes."""

    @abstractmethod
    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Any:
        """Learn from labelled hypervectors, and return a state.

        Args:
            words: N hypervectors.
            rows: their classes int64 [N] (CPU); each of 0 … L − 1 occurs.
            n_classes: L.
        """

    @abstractmethod
    def scores(self, state: Any, words: Hypervectors) -> Tensor:
        """Scores of the classes [Q, L]; the largest wins, and the first of equal ones."""

    def held_out(
        self, state: Any, words: Hypervectors | None, rows: Tensor
    ) -> HeldOut | None:
        """Scores of left-out training frames, if they have a closed form.

        Args:
            state: the trained state.
            words: some of the training frames, for a read-out that learns batch by batch.
            rows: their classes int64 [m] (CPU).

        Returns:
            The scores of these frames, or of frames chosen in training; None without a closed form.
        """
        found: HeldOut | None = state.held_out
        return found

    def needed(self, state: Any) -> dict[str, Tensor]:
        """The tensors that a prediction needs, which share memory with the state."""
        tensors = state.tensors()
        return {name: tensors[name] for name in self.needs or tensors}

    def restored(
        self, tensors: Mapping[str, Tensor], n_classes: int, dimension: int
    ) -> Any:
        """The state from the tensors of a file.

        Raises:
            ValueError: if they do not fit.
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
    """Base class of read-outs that learn batch by batch, and may learn new classes later.

    A class without training frames must never have the largest score.
    """

    held_out: Any = None
    """The method of :class:`Readout`, if the read-out can score left-out frames."""

    @abstractmethod
    def empty(self, n_classes: int, dimension: int, device: torch.device | str) -> Any:
        """The state before any training."""

    @abstractmethod
    def add(self, state: Any, batches: Iterable[tuple[Hypervectors, Tensor]]) -> Any:
        """The state after more batches of hypervectors and their classes int64 [N]."""

    @abstractmethod
    def arrange(self, state: Any, places: Sequence[int], n_classes: int) -> Any:
        """The state for n_classes classes, in which class k becomes class places[k]."""

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Any:
        start = self.empty(n_classes, words.dimension, words.packed.device)
        return self.add(start, [(words, rows)])
