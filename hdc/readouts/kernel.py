"""Discriminant analysis with a kernel of Hamming distances.

The products G of :mod:`hdc.readouts.discriminant` are exp(−H/(s·m)), with the Hamming distances H
of the training hypervectors and their median m over pairs: a Laplacian kernel (Chapelle, Haffner,
Vapnik, IEEE Trans. Neural Netw. 10, 1055 (1999)), since H of levels is a sum of absolute
differences. The penalty is ℓ = λ·tr(K)/N. The factors s and λ are chosen by the fewest errors on
left-out training frames, in closed form (:mod:`hdc.readouts.discriminant`). A read-out does not
know groups, so this choice is not made across groups.

Scores are floats: with another backend, processor or number of threads they may differ in their
last digits, and the predicted class may differ if two scores are that close.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.parameters import is_number
from hdc.readouts.base import Readout, State
from hdc.readouts.discriminant import (
    Problem,
    Solution,
    check_memory,
    discriminants,
    evenly,
    held_out_of,
)
from hdc.tensors import Kinds
from hdc.warning import warn


@dataclass(frozen=True, kw_only=True, eq=False)
class Expansion(State):
    """The kernel expansion of each class: a weight for every training frame."""

    kinds: ClassVar[Kinds] = {
        "frames": "int64 N W",
        "dual": "float64 N L",
        "offsets": "float64 L",
        "reach": "float64",
        "scale": "float64",
        "penalty": "float64",
    }
    frames: Tensor
    """int64 [N, W], the hypervectors of all training frames."""
    dual: Tensor
    """float64 [N, L] (CPU)."""
    offsets: Tensor
    """float64 [L] (CPU)."""
    reach: Tensor
    """float64 [], s·m: the distance in bits at which the kernel is 1/e."""
    scale: Tensor
    """float64 [], s."""
    penalty: Tensor
    """float64 [], λ."""

    def check(self) -> None:
        if float(self.reach) <= 0:
            raise ValueError(f"reach: expected one above zero, found {self.reach}")


class Kernel(Readout):
    """Discriminant analysis with a kernel, which stores the hypervectors of all training frames.

    Args:
        scales: values of s to choose from, above zero; the first of equally good ones is taken.
        penalties: values of λ to choose from, above zero.
    """

    State = Expansion
    needs = ("frames", "dual", "offsets", "reach")

    def __init__(
        self,
        scales: Sequence[float] = (1, 2, 0.5, 0.25),
        penalties: Sequence[float] = (0.1, 0.3, 0.03),
    ):
        self.scales = scales
        self.penalties = penalties

    def check(self) -> None:
        _check_positive("scales", self.scales)
        _check_positive("penalties", self.penalties)

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Expansion:
        """See :meth:`hdc.readouts.base.Readout.fit`.

        Raises:
            ValueError: for more than 8000 frames, for which the kernel of all pairs is too large.
        """
        check_memory("kernel", len(rows))
        distances = bits.hamming(words.packed, words.packed).cpu()
        best = fewest_errors(distances, rows, self.scales, self.penalties)
        dual, offsets, products = best.solution
        if products.penalty is None:
            warn(
                "kernel: no class has two different frames, so the nearest mean is learned",
            )
        return Expansion(
            frames=words.packed,
            dual=dual,
            offsets=offsets,
            reach=_number(best.reach),
            scale=_number(best.scale),
            penalty=_number(best.penalty),
            held_out=held_out_of(products, rows),
        )

    def scores(self, state: Expansion, words: Hypervectors) -> Tensor:
        """The discriminants, float64 [Q, L]."""
        distances = bits.hamming(words.packed, state.frames)
        near = likeness(distances, float(state.reach))
        dual = state.dual.to(near.device)
        return near @ dual + state.offsets.to(near.device)


class Tried(NamedTuple):
    """A choice of factors, and its errors on left-out training frames.

    Attributes:
        errors: number of wrong frames.
        scale, penalty: s and λ.
        reach: s·m, in the unit of the distances.
        solution: the discriminants.
    """

    errors: int
    scale: float
    penalty: float
    reach: float
    solution: Solution


def fewest_errors(
    distances: Tensor,
    place: Tensor,
    scales: Sequence[float],
    penalties: Sequence[float],
) -> Tried:
    """The factors with the fewest errors, and the first of equal ones.

    Args:
        distances: distances of any kind between the training frames, [N, N] (CPU).
        place: their classes int64 [N]; each of 0 … L − 1 occurs.
        scales, penalties: values of s and λ, above zero.
    """
    median = median_of_pairs(distances)
    # Only on evenly spread frames, so that classes count in proportion to their frames.
    even = evenly(len(place))
    tried = []
    for scale in scales:
        reach = scale * median
        problem = Problem.of(likeness(distances, reach), place)
        for penalty in penalties:
            strength = penalty * problem.trace / len(place)
            solution = problem.solve(None if problem.is_empty else strength)
            scores, places = discriminants(solution.products, place)
            is_wrong = scores.argmax(1) != place[places]
            errors = int(is_wrong[torch.isin(places, even)].sum())
            tried.append(Tried(errors, scale, penalty, reach, solution))
    return min(tried, key=lambda one: one.errors)


def likeness(distances: Tensor, reach: float) -> Tensor:
    """exp(−distance/reach), float64."""
    return distances.to(torch.float64, copy=True).div_(-reach).exp_()


def median_of_pairs(distances: Tensor) -> float:
    """The lower median of the distances [N, N] of all pairs; 1 if it is zero.

    The matrix holds each pair twice, and N zeros.
    """
    n = len(distances)
    n_pairs = n * (n - 1) // 2
    if n_pairs == 0:
        return 1.0
    place = n + 2 * ((n_pairs - 1) // 2)
    flat = distances.numpy().ravel()
    return float(np.partition(flat, place)[place]) or 1.0


def _number(value: float) -> Tensor:
    return torch.tensor(value, dtype=torch.float64)


def _check_positive(name: str, values: Any) -> None:
    """Raise ValueError for anything but a list of numbers above zero."""
    is_list = isinstance(values, list | tuple) and len(values) > 0
    if not is_list or not all(is_number(value) and value > 0 for value in values):
        raise ValueError(
            f"{name}: expected a list of numbers above zero, found {values!r}"
        )
