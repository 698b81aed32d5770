"""When a run stops, and what the stop is called."""

from __future__ import annotations

import math
from dataclasses import dataclass

NAMES = ("finished", "trained", "reached", "steps", "budget", "diverged")


@dataclass(frozen=True)
class StopRule:
    """Name the reason to stop a run at one of its reports; no report before it has a say.

    A model that has nothing left to do has ``finished``. A model that reports no loss learns in one
    pass and is left to finish. Of the others, one whose loss is not finite has ``diverged``; with
    `reached_after_s`, one whose training accuracy exceeds the target has ``reached`` it. One is
    ``trained`` whose loss, the mean over its last epoch, is at most `loss` after `least_steps`; one
    that got nowhere near it in `most_steps` is out of ``steps``, and one that used up its training
    time out of ``budget``. Both numbers of steps are of the optimiser and the same for any number
    of training samples. The test accuracy never decides.

    Args:
        target: accuracy in (0, 1) to exceed.
        reached_after_s: seconds of training from which exceeding it ends a run; None for never.
        loss: mean training loss of an epoch, at least 0 and small where all is learnt.
        least_steps: a small training set has a small loss after a few steps, long before the model
            has settled.
        most_steps: at least `least_steps`.
        budget_s: seconds of training time.
    """

    target: float = 0.9
    reached_after_s: float | None = None
    loss: float = 0.01
    least_steps: int = 200
    most_steps: int = 2000
    budget_s: float = 1800.0

    def __post_init__(self) -> None:
        if not 0 < self.target < 1:
            raise ValueError(f"stop.target: expected a number in (0, 1), found {self.target}")
        if self.reached_after_s is not None and not self.reached_after_s >= 0:
            raise ValueError(
                f"stop.reached_after_s: expected null or at least 0 s, found {self.reached_after_s}"
            )
        if not self.loss >= 0:
            raise ValueError(f"stop.loss: expected at least 0, found {self.loss}")
        if self.least_steps < 0:
            raise ValueError(f"stop.least_steps: expected at least 0, found {self.least_steps}")
        if self.most_steps < max(1, self.least_steps):
            raise ValueError(
                f"stop.most_steps: expected at least {max(1, self.least_steps)}, "
                f"found {self.most_steps}"
            )
        if not self.budget_s > 0:
            raise ValueError(f"stop.budget_s: expected more than 0 s, found {self.budget_s}")

    def check(
        self, training_s: float, steps: float, loss: float | None, train_accuracy: float = 0.0
    ) -> str | None:
        """The name of the reason to stop now, or None.

        Args:
            training_s: seconds of training.
            steps: of the optimiser; 0 for a model that has none.
            loss: as the model reports it; None for one that learns in one pass.
            train_accuracy: now, as far as it is known.
        """
        if loss is not None:
            if not math.isfinite(loss):
                return "diverged"
            waited = self.reached_after_s is not None and training_s >= self.reached_after_s
            if waited and train_accuracy > self.target:
                return "reached"
            if steps >= max(1, self.least_steps) and loss <= self.loss:
                return "trained"
            if steps >= self.most_steps:
                return "steps"
        return "budget" if training_s >= self.budget_s else None
