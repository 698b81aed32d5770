"""When a run stops, and the name of the reason."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

NAMES = ("finished", "trained", "reached", "steps", "budget", "diverged")


@dataclass(frozen=True)
class StopRule:
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

    Raises:
        ValueError: naming the value that is out of range.
    """

    target: float = 0.9
    reached_after_s: float | None = None
    loss: float = 0.01
    least_steps: int = 200
    most_steps: int = 2000
    budget_s: float = 1800.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not isinstance(value, int | float) and (name, value) != (
                "reached_after_s",
                None,
            ):
                raise ValueError(f"stop.{name}: expected a number, found {value!r}")
        least, after = max(1, self.least_steps), self.reached_after_s
        for name, valid, expected in (
            ("target", 0 < self.target < 1, "a number in (0, 1)"),
            ("reached_after_s", after is None or after >= 0, "null or at least 0 s"),
            ("loss", self.loss >= 0, "at least 0"),
            ("least_steps", self.least_steps >= 0, "at least 0"),
            ("most_steps", self.most_steps >= least, f"at least {least}"),
            ("budget_s", self.budget_s > 0, "more than 0 s"),
        ):
            if not valid:
                raise ValueError(
                    f"stop.{name}: expected {expected}, found {getattr(self, name)}"
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
            waited = (
                self.reached_after_s is not None and training_s >= self.reached_after_s
            )
            if waited and train_accuracy > self.target:
                return "reached"
            if steps >= max(1, self.least_steps) and loss <= self.loss:
                return "trained"
            if steps >= self.most_steps:
                return "steps"
        return "budget" if training_s >= self.budget_s else None
