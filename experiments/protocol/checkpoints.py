"""Evaluation checkpoints: when a model in training is tested, as often as its curve needs.

Predicting all frames can take longer than the steps between two checkpoints: for three
convolutions it took half of a run. A model that learns by steps may report ``batch_accuracy``, its
accuracy on the last minibatches before it learnt from them, which costs nothing. Far below the
target it shows that predicting the training frames is not worth its time.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

# Share of the target below which the training frames are not predicted. Half, since the accuracy of
# a network jumps and that of its last minibatches lags behind.
_NEAR = 0.5
# Training accuracy from which a curve has nothing more to tell: the paper's all lie below it.
_LEARNT = 0.995
# Samples seen between two checkpoints, as a share of those seen so far.
_DOUBLE, _FIFTH, _TENTH, _TWENTIETH = 1.0, 0.2, 0.1, 0.05


class Due(IntEnum):
    """Frames that a model predicts at a report."""

    NOTHING = 0
    TEST = 1  # the test frames alone, for the curve
    ALL = 2  # the training frames as well


class Checkpoints:
    """The checkpoints of one training, from its first report to its last.

    Three cases. A model that reports no loss learns in one pass: its checkpoints are at twice the
    samples each time, and at all of them. A model that reports its loss has one at a tenth more
    samples, because its training accuracy may exceed the target at any report. A model that also
    reports its ``batch_accuracy`` has one at a twentieth more from half of the target on, since its
    training accuracy rises steeply there; below, it predicts the test frames alone, at twice the
    samples. Once it has learnt nearly every training frame, a fifth more is enough.

    Args:
        target: training accuracy that ends the training time.
        n_train: number of training frames.
    """

    def __init__(self, target: float, n_train: int):
        self._target, self._n_train = target, n_train
        self._test_due = 0.0  # samples seen at the next prediction of the test frames
        self._train_due = 0.0  # and of the training frames
        self._near = self._learnt = False

    def due(self, report: Mapping[str, float]) -> Due:
        """Frames to predict at this report."""
        seen = report.get("samples_seen", 0)
        if self._is_near(report) and seen >= self._train_due:
            return Due.ALL
        if seen >= self._test_due:
            return Due.TEST if "batch_accuracy" in report else Due.ALL
        return Due.NOTHING

    def passed(self, report: Mapping[str, float], train_accuracy: float | None) -> None:
        """Note that the model was tested at a report, and its training accuracy if it is known."""
        seen = report.get("samples_seen", 0)
        if "loss" not in report:
            due = min(2 * seen, self._n_train)
            self._test_due = self._train_due = due
            return
        if train_accuracy is not None:
            self._near |= train_accuracy > self._target
            self._learnt |= train_accuracy > _LEARNT
        if "batch_accuracy" in report:
            near, far = _FIFTH if self._learnt else _TWENTIETH, _DOUBLE
        else:
            near = far = _TENTH
        self._train_due, self._test_due = seen + near * seen, seen + far * seen

    def _is_near(self, report: Mapping[str, float]) -> bool:
        """Whether the training accuracy may exceed the target at this report."""
        batch_accuracy = report.get("batch_accuracy")
        if batch_accuracy is None:
            return True
        return self._near or batch_accuracy >= _NEAR * self._target
