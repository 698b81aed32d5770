"""The training loop: a model learns under the clock, is tested with it stopped, and ends by a rule.

Every training of the harness is one call of :func:`train`.
"""

from __future__ import annotations

import numbers
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from baselines import library
from experiments.protocol.clock import Clock
from experiments.protocol.model import Model
from experiments.protocol.stop import StopRule

_WARM_UP_FRAMES = 40
# Keys of a row of a curve that the loop sets.
_OWN_KEYS = {"training_s", "train_accuracy", "test_accuracy"}

Report = dict[str, float]
Test = Callable[[Report, bool], Report | None]
"""Called at each report of a model with the report, and whether the training ends there; returns
the accuracies of the model as it is, or None where it is not tested."""


@dataclass(frozen=True)
class Trial:
    """A training and its tests, as far as they have come.

    Attributes:
        curve: a row a checkpoint: the model's report, ``training_s`` and the accuracies.
        stop: why the training ended, one of :data:`experiments.protocol.stop.NAMES`.
        training_s: seconds of training.
    """

    curve: tuple[Report, ...] = ()
    stop: str | None = None
    training_s: float | None = None

    def after(self, report: Report, accuracies: Report | None) -> Trial:
        """The trial with one checkpoint more, if the model was tested there."""
        if accuracies is None:
            return self
        rows = (*self.curve, {**report, **accuracies})
        return replace(self, curve=rows, training_s=report["training_s"])


def untested(report: Report, at_end: bool) -> None:
    """The test of a training without checkpoints."""


def train(
    model: Model,
    name: str,
    frames: Any,
    labels: np.ndarray,
    stop: StopRule,
    clock: Clock,
    test: Test = untested,
) -> Iterator[Trial]:
    """Train a model until it returns or the rule ends it.

    Args:
        model: starts anew.
        name: for messages.
        frames, labels: training samples.
        stop: the rule.
        clock: runs while the model learns.
        test: tests the model where it has a checkpoint.

    Yields:
        The trial after each checkpoint, and at last with its ``stop``.

    Raises:
        ValueError: for a report that is not made of numbers, or has a key of the loop.
    """
    trial = Trial()
    report: Report = {}
    accuracies: Report | None = None
    reason: str | None = None
    for report in _reports(model, name, frames, labels, clock):
        state = report["training_s"], report.get("steps", 0), report.get("loss")
        reason, accuracies = stop.check(*state), None
        if reason is None:
            accuracies = test(report, False)
        if accuracies is not None:
            trial = trial.after(report, accuracies)
            yield trial
            reason = stop.check(*state, accuracies.get("train_accuracy", 0.0))
        if reason is not None:
            break
    if report and accuracies is None:
        trial = trial.after(report, test(report, True))
    yield replace(trial, stop=reason or "finished", training_s=clock.seconds)


def _reports(
    model: Model,
    name: str,
    frames: Any,
    labels: np.ndarray,
    clock: Clock,
) -> Iterator[Report]:
    """Reports of a model in training with ``training_s``, the clock stopped in between."""
    with clock.running():
        iterator = iter(library.train(model, frames, labels))
    while True:
        with clock.running():
            report = next(iterator, None)
        if report is None:
            return
        for key, value in report.items():
            what = f"model {name}: report[{key!r}]"
            if key in _OWN_KEYS:
                raise ValueError(f"{what}: expected no such key")
            if not isinstance(value, numbers.Real) or isinstance(value, bool):
                raise ValueError(f"{what}: expected a number, found {value!r}")
        yield {"training_s": clock.seconds, **report}


def warm_up(model: Model, shape: tuple[int, int], n_train: int) -> None:
    """Train and predict once on noise, because the first use of anything is slow.

    Args:
        model: is not used again.
        shape: of a frame, in pixels.
        n_train: training frames that there will be; the noise has at most 40.
    """
    n = min(n_train, _WARM_UP_FRAMES)
    generator = torch.Generator().manual_seed(0)
    size = (n, *shape)
    frames = torch.randint(0, 256, size, generator=generator, dtype=torch.uint8)
    next(iter(library.train(model, frames, np.arange(n) % 2)), None)
    model.predict(frames[:2])
