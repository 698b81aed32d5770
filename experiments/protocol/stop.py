"""When a run stops, and what the stop is called."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

UNTIL = ("reached", "plateau")
NAMES = ("finished", "reached", "plateau", "budget", "diverged")


@dataclass
class StopRule:
    """Watch a run's progress and name the reason to stop it.

    A model that has nothing left to do has ``finished``. A model that reports no loss learns in one
    pass and is left to finish. Of the others, one whose loss is not finite has ``diverged``; with
    ``until="reached"`` one whose training accuracy exceeds the target after `at_least_s` has
    ``reached`` it; one whose best training accuracy has not grown for `patience` reports is on a
    ``plateau`` (the test accuracy never decides). One that used up its training time is out of
    ``budget``.

    Args:
        target: accuracy in (0, 1) to exceed.
        until: ``"reached"`` or ``"plateau"``.
        patience: reports without a better training accuracy.
        patience_below: the same while the target has never been exceeded, where learning that has
            hardly begun looks like a plateau; None for `patience`.
        budget_s: seconds of training time.
        at_least_s: with ``"reached"``, train for this many seconds even so, unless nothing is
            left to do: what is cheap is trained to its end.
    """

    target: float = 0.9
    until: str = "plateau"
    patience: int = 5
    budget_s: float = 1800.0
    at_least_s: float = 0.0
    patience_below: int | None = None
    _best: float = field(default=-1.0, init=False, repr=False)
    _stale: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.until not in UNTIL:
            raise ValueError(
                f"stop.until: expected one of {', '.join(UNTIL)}, found {self.until!r}"
            )
        if not 0 < self.target < 1:
            raise ValueError(f"stop.target: expected a number in (0, 1), found {self.target}")
        if self.patience < 1:
            raise ValueError(f"stop.patience: expected at least 1, found {self.patience}")
        if self.patience_below is not None and self.patience_below < 1:
            raise ValueError(
                f"stop.patience_below: expected at least 1, found {self.patience_below}"
            )
        if not self.budget_s > 0:
            raise ValueError(f"stop.budget_s: expected more than 0 s, found {self.budget_s}")
        if not 0 <= self.at_least_s <= self.budget_s:
            raise ValueError(
                f"stop.at_least_s: expected 0 s to the budget of {self.budget_s} s, "
                f"found {self.at_least_s}"
            )

    def check(self, training_s: float, loss: float | None, train_accuracy: float) -> str | None:
        """The name of the reason to stop now, or None."""
        out_of_time = "budget" if training_s >= self.budget_s else None
        if loss is None:
            return out_of_time
        if not math.isfinite(loss):
            return "diverged"
        enough = training_s >= self.at_least_s
        if self.until == "reached" and enough and train_accuracy > self.target:
            return "reached"
        self._stale = 0 if train_accuracy > self._best else self._stale + 1
        self._best = max(self._best, train_accuracy)
        patience = self.patience
        if self._best <= self.target and self.patience_below is not None:
            patience = self.patience_below
        return "plateau" if self._stale >= patience else out_of_time
