"""When a run stops, and the name of the reason."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
from msgspec import Meta

NAMES = ("finished", "trained", "reached", "steps", "budget", "diverged")


class StopRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Return why to stop at this report, or None.

    ============  ==================================================================================
    ``finished``  the model returned
    ``diverged``  its loss is not finite
    ``reached``   with `reached_after_s`: its training accuracy exceeds the target
    ``trained``   its loss, the mean over its last epoch, is at most `loss` after `least_steps`
    ``steps``     it has taken `most_steps` and is not trained
    ``budget``    it has used up its training time
    ============  ==================================================================================

    A model that reports no loss learns in one pass; only its budget ends it early. The test
    accuracy never decides.

    Args:
        target: accuracy in (0, 1) to exceed.
        reached_after_s: seconds of training from which exceeding it ends a run; None for never.
        loss: mean training loss of an epoch.
        least_steps: of the optimiser: a small training set has a small loss after a few.
        most_steps: at least `least_steps`.
        budget_s: seconds of training time.

    Values from a config are checked by :func:`experiments.protocol.settings.checked`.

    Raises:
        ValueError: for fewer `most_steps` than `least_steps`.
    """

    target: Annotated[float, Meta(gt=0, lt=1)] = 0.9
    reached_after_s: Annotated[float, Meta(ge=0)] | None = None
    loss: Annotated[float, Meta(ge=0)] = 0.01
    least_steps: Annotated[int, Meta(ge=0)] = 200
    most_steps: int = 2000
    budget_s: Annotated[float, Meta(gt=0)] = 1800.0

    def __post_init__(self) -> None:
        least = max(1, self.least_steps)
        if self.most_steps < least:
            raise ValueError(
                f"stop.most_steps: expected at least {least}, found {self.most_steps}"
            )

    def check(
        self,
        training_s: float,
        steps: float,
        loss: float | None,
        train_accuracy: float = 0.0,
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
            wait = self.reached_after_s
            has_waited = wait is not None and training_s >= wait
            if has_waited and train_accuracy > self.target:
                return "reached"
            if steps >= max(1, self.least_steps) and loss <= self.loss:
                return "trained"
            if steps >= self.most_steps:
                return "steps"
        return "budget" if training_s >= self.budget_s else None
