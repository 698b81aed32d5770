"""What can be read off one learning curve, by every rule that Table I may have been read by.

- R1: at the first report whose training accuracy exceeds 90 %, where the paper takes its time;
- R2: at the first report whose training accuracy reaches the published maximum;
- R3: the maxima of both accuracies up to ``window`` times the steps of R1;
- R4: the maxima up to where the loss stands still, or the budget of steps ends.

The loss stands still at a multiple of ``steps`` if its least value since the one before lies less
than ``fall`` below the least before that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from experiments.records.measurement import Row

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Levels:
    """Where curves are read.

    Args:
        reached: training accuracy of R1, exceeded.
        published: training accuracy of R2, reached.
        test: test accuracies to which the steps are told: the published one and the ends of its
            interval.
        window: of R3, in steps of R1.
        plateau_steps, plateau_fall: of R4.

    Raises:
        ValueError: naming the field that is out of range.
    """

    reached: float
    published: float
    test: Sequence[float]
    window: float
    plateau_steps: int
    plateau_fall: float

    def __post_init__(self) -> None:
        if not self.window >= 1:
            raise ValueError(f"window: expected a number from 1, found {self.window!r}")
        if not (isinstance(self.plateau_steps, int) and self.plateau_steps > 0):
            raise ValueError(
                f"plateau_steps: expected a positive integer, found {self.plateau_steps!r}"
            )


@dataclass
class Curve:
    """A report at each of some steps.

    Attributes:
        start: loss of all training frames before the first step.
        steps, loss, train, test: of each report; accuracies are fractions.
        projected: test accuracy had the start been projected on the span of the training frames;
            empty where that is not known.
        plateau: the step at which the loss stood still, if it did.
    """

    start: float
    steps: list[int] = field(default_factory=list)
    loss: list[float] = field(default_factory=list)
    train: list[float] = field(default_factory=list)
    test: list[float] = field(default_factory=list)
    projected: list[float] = field(default_factory=list)
    plateau: int | None = None

    def first(self, values: Sequence[float], level: float, exceeded: bool = False) -> int | None:
        """The first report at which a value is at least (exceeds) the level."""
        found = np.asarray(values) > level if exceeded else np.asarray(values) >= level - 1e-9
        return int(found.argmax()) if found.any() else None

    def check(self, levels: Levels) -> bool:
        """Note a plateau; whether one is behind, and nothing that is to be read still to come."""
        step, every = self.steps[-1], levels.plateau_steps
        if step % every:
            return False
        if self.plateau is None:
            now = min(x for s, x in zip(self.steps, self.loss, strict=True) if s > step - every)
            before = [x for s, x in zip(self.steps, self.loss, strict=True) if s <= step - every]
            if min(before, default=self.start) - now < levels.plateau_fall:
                self.plateau = step
        crossing = self.first(self.train, levels.reached, exceeded=True)
        passed = crossing is None or step >= levels.window * self.steps[crossing]
        return self.plateau is not None and passed


def read(curve: Curve, levels: Levels) -> Row:
    """The readings as columns; what was not reached is None.

    ``rK_steps``: steps to the reading, of R3 and R4 to the end of what the maxima are over;
    ``rK_train``, ``rK_test``, ``rK_projected``: accuracies; ``test_steps_0…``: steps to each test
    accuracy of the levels; ``plateau``: whether R4 ended at one, or at the budget.
    """
    row: Row = {}
    steps = np.array(curve.steps)
    first = curve.first(curve.train, levels.reached, exceeded=True)
    at = {"r1": first, "r2": curve.first(curve.train, levels.published)}
    for name, k in at.items():
        row |= _reading(curve, name, None if k is None else slice(k, k + 1))
    window = None if first is None else levels.window * steps[first]
    seen = window is not None and steps[-1] >= window
    row |= _reading(curve, "r3", slice(0, int((steps <= window).sum())) if seen else None)
    until = curve.plateau or steps[-1]
    row |= _reading(curve, "r4", slice(0, int((steps <= until).sum())))
    for k, level in enumerate(levels.test):
        found = curve.first(curve.test, level)
        row[f"test_steps_{k}"] = None if found is None else curve.steps[found]
    end = curve.loss[-1]
    return row | {
        "plateau": "yes" if curve.plateau else "no",
        "steps": int(steps[-1]),
        "train_end": curve.train[-1],
        "test_end": curve.test[-1],
        "loss_start": curve.start,
        "loss_end": end,
        "diverged": "no" if math.isfinite(end) and end <= curve.start else "yes",
    }


def _reading(curve: Curve, name: str, part: slice | None) -> Row:
    parts = {"train": curve.train, "test": curve.test, "projected": curve.projected}
    row: Row = {f"{name}_steps": curve.steps[part][-1] if part else None}
    for key, values in parts.items():
        row[f"{name}_{key}"] = max(values[part]) if part and values else None
    return row


def report(logits: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy and accuracy of logits [n, L, V], one of each start: [V], [V].

    A frame whose class shares the highest logit counts as right; a logit that is no number, as
    wrong.
    """
    highest = logits.amax(dim=1)
    import torch  # what shows curves reads them without it

    right = logits[torch.arange(len(targets)), targets]
    loss = highest + (logits - highest[:, None]).exp_().sum(dim=1).log() - right
    return loss.mean(dim=0), (right >= highest).double().mean(dim=0)
