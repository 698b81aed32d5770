"""Ridge regression of classes and of numbers, by :mod:`hdc.readouts.least_squares`."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.parameters import is_number
from hdc.readouts.base import HeldOut, Readout
from hdc.readouts.least_squares import Dual, Primal, smoother_of, solve
from hdc.readouts.linear import Linear
from hdc.readouts.values import RESIDUALS, ValueReadout, ValueState
from hdc.tensors import Kinds


class Ridge(Readout):
    """Ridge regression of 1 for the class of a frame and −1 for the others.

    Args:
        penalty: λ in units of the mean of K's diagonal; None takes the one of
            :data:`hdc.readouts.least_squares.PENALTIES` with the least leave-one-out error.
    """

    State = Linear
    needs = ("weights", "scales", "intercepts")
    adapts_by = ()

    def __init__(self, penalty: float | None = None):
        self.penalty = penalty

    def check(self) -> None:
        check_penalty(self.penalty)

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Linear:
        return _of_classes(words, rows, n_classes, self.penalty)

    def adapt(self, state: Linear, words: Hypervectors, rows: Tensor) -> Linear:
        """Fit new frames, with the penalty on the change of the weights."""
        return _of_classes(words, rows, len(state.weights), prior=state)

    def scores(self, state: Linear, words: Hypervectors) -> Tensor:
        """The linear functions, float64 [Q, L]."""
        return state.values(words)


def _of_classes(
    words: Hypervectors,
    rows: Tensor,
    n_classes: int,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> Linear:
    """The fit to 1 for the class of a frame and −1 for the others."""
    onehot = torch.eye(n_classes, dtype=torch.float64)[rows]
    targets = 2 * onehot - 1
    linear, residuals = solve(words, targets, penalty, prior)
    return replace(linear, held_out=HeldOut(targets - residuals, rows))


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearValues(Linear, ValueState):
    """A linear function of each number."""

    kinds: ClassVar[Kinds] = {**Linear.kinds, **RESIDUALS}

    @functools.cached_property
    def smoother(self) -> Dual | Primal:
        """The smoother that intervals need."""
        return smoother_of(self.words, float(self.penalty))


class RidgeValues(ValueReadout):
    """Ridge regression of numbers.

    Args:
        penalty: as in :class:`Ridge`.
    """

    State = LinearValues

    def __init__(self, penalty: float | None = None):
        self.penalty = penalty

    def check(self) -> None:
        check_penalty(self.penalty)

    def fit(self, words: Hypervectors, values: Tensor) -> LinearValues:
        return _of_numbers(words, values, self.penalty)

    def adapt(
        self, state: LinearValues, words: Hypervectors, values: Tensor
    ) -> LinearValues:
        """Fit new frames, with the penalty on the change of the weights."""
        return _of_numbers(words, values, prior=state)

    def values(self, state: LinearValues, words: Hypervectors) -> Tensor:
        return state.values(words).cpu()

    def without(
        self, state: LinearValues, words: Hypervectors
    ) -> tuple[Tensor, Tensor]:
        """Predictions without frame i follow from f(x) − f₋ᵢ(x) = S_i(x)·r_i."""
        centre = self.values(state, words)
        smoother = state.smoother.of_queries(words)
        assert state.residuals is not None
        moved = smoother[..., None] * state.residuals
        return centre, centre[:, None] - moved


def _of_numbers(
    words: Hypervectors,
    values: Tensor,
    penalty: float | None = None,
    prior: Linear | None = None,
) -> LinearValues:
    linear, residuals = solve(words, values, penalty, prior)
    given: Any = linear.tensors()
    return LinearValues(**given, residuals=residuals, words=words, targets=values)


def check_penalty(penalty: Any) -> None:
    """Raise ValueError for a penalty that is neither None nor a number above zero."""
    if penalty is None:
        return
    if not is_number(penalty) or penalty <= 0:
        raise ValueError(
            f"penalty: expected a number above zero or None, found {penalty!r}"
        )
