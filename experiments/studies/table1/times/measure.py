"""The grid of times: Table I by other implementations than its own, in turns in one process.

An implementation is compared with itself alone: networks by standard libraries with HDC by standard
libraries, tuned with tuned. Each turn has a seed of its own. Within a turn the models train one
after another, with HDC before and after each of them, so that a ratio is one of neighbours in time.
A call that is interrupted leaves nothing behind.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import msgspec
import numpy as np
import torch
from torch import Tensor

from experiments.protocol import data, machine
from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.protocol.clock import Clock
from experiments.protocol.data import at_seed
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.protocol.trial import Report, Test, Trial, train, untested, warm_up
from hdc.accuracy import accuracy
from scenes.frames import Scene

HDC = "hdc"
TO_ITS_END = StopRule(loss=0.0, most_steps=sys.maxsize, budget_s=math.inf)

Config = Mapping[str, Any]  # as a file of configs/model/ makes it
Ways = Mapping[str, Mapping[str, Config]]


class TimesGrid(Task, frozen=True):
    """One row: one training of a model by a way, ``seconds`` until its training accuracy exceeds
    the target, of a model `to_end` or of one pass until it is fitted; None where it never does.

    ``trained_s`` is how long it trained in all; ``train_accuracy`` and ``test_accuracy`` are those
    reached; ``hdc_seconds`` the mean time of HDC by the same way just before and just after; in
    rows of HDC itself both are its median in that turn.
    Arguments: configs/experiment/times_grid.yaml.

    Raises:
        ValueError: for a way without HDC, or in a process that has kept memory for an earlier run.
    """

    revision: ClassVar = 2
    timed: ClassVar = True
    own_memory: ClassVar = True

    scene: Mapping[str, Any]
    split: Split
    stop: StopRule
    seeds: Sequence[int]
    ways: Ways
    keep_memory: Sequence[str]
    to_end: Sequence[str]
    fewer: Mapping[str, int]

    def rows(self, context: Context) -> Iterator[Row]:
        _check(self.ways, self.keep_memory)
        turns = {
            seed: _training(
                context, self.scene, self.split, self.stop, self.to_end, seed
            )
            for seed in self.seeds
        }
        for way, models in self.ways.items():
            if way in self.keep_memory:
                machine.keep_memory()
            for config in models.values():
                next(iter(turns.values())).warm_up(config["model"])
            for turn, (seed, training) in enumerate(turns.items()):
                here = {
                    name: at_seed(config["model"], seed)
                    for name, config in models.items()
                    if turn < self.fewer.get(name, len(turns))
                }
                for row in one_turn(training, here):
                    yield {
                        "origin": training.scene.origin,
                        "seed": seed,
                        "way": way,
                        "turn": turn,
                        **row,
                    }
                    context.note(
                        f"{way}, seed {seed}, {row['model']}: {row['seconds']} s"
                    )


def _check(ways: Ways, keep_memory: Sequence[str]) -> None:
    for way, models in ways.items():
        if HDC not in models:
            found = ", ".join(models)
            raise ValueError(
                f"task.ways.{way}: expected {HDC} among them, found {found}"
            )
    first = next(iter(ways))
    if first not in keep_memory and machine.keeps_memory():
        raise ValueError(
            f"task.ways.{first}: expected a process of its own, found one in which an earlier "
            "run has kept memory"
        )


@dataclass
class Samples:
    """Frames in memory and their labels."""

    frames: Tensor
    labels: np.ndarray


@dataclass
class Trained:
    """What came of one training.

    Attributes:
        seconds: until the target; infinite where it was not reached.
        trained_s: of the whole training.
        train_accuracy, test_accuracy: of the model as it then was.
    """

    seconds: float
    trained_s: float
    train_accuracy: float
    test_accuracy: float


@dataclass
class Training:
    """Trains models on the same frames, each to the same target.

    Args:
        scene: what the frames are of.
        train, test: the samples.
        stop: its target ends a training, and its other rules one that does not get there.
        to_end: names of models that are trained until they have converged, and so are any that
            learn in one pass.
    """

    scene: Scene
    train: Samples
    test: Samples
    stop: StopRule
    to_end: Sequence[str] = ()

    def seconds(self, config: Config) -> float:
        """Seconds in which HDC learns, not tested."""
        return self._train(self._built(config), HDC, TO_ITS_END).training_s or 0.0

    def carry_out(self, name: str, config: Config) -> Trained:
        """Train a model until its training accuracy exceeds the target, or to its end, and test
        it."""
        model = self._built(config)
        checkpoints = Checkpoints(self.stop.target, len(self.train.labels))

        def test(report: Report, at_end: bool) -> Report | None:
            in_one_go = name in self.to_end or "steps" not in report
            is_due = not in_one_go and checkpoints.due(report) is Due.ALL
            if not (at_end or is_due):
                return None
            share = self._accuracy(model, self.train)
            checkpoints.passed(report, share)
            return {"train_accuracy": share}

        rule = TO_ITS_END
        if name not in self.to_end:
            rule = msgspec.structs.replace(self.stop, reached_after_s=0.0)
        with machine.libraries(config, torch.get_num_threads()):
            trial = self._train(model, name, rule, test)
            test_accuracy = self._accuracy(model, self.test)
        last = trial.curve[-1]
        reached = trial.stop == "finished"
        if name not in self.to_end and "steps" in last:
            reached = last["train_accuracy"] > self.stop.target
        trained_s = trial.training_s or 0.0
        seconds = trained_s if reached else math.inf
        return Trained(seconds, trained_s, last["train_accuracy"], test_accuracy)

    def warm_up(self, config: Config) -> None:
        """Train and predict once on noise."""
        with machine.libraries(config, torch.get_num_threads()):
            warm_up(self._built(config), self.scene.shape, len(self.train.labels))

    def _built(self, config: Config) -> Model:
        model: Model = instantiate(config, "model")
        check_model(model)
        return model

    def _train(
        self, model: Model, name: str, rule: StopRule, test: Test = untested
    ) -> Trial:
        samples = self.train.frames, self.train.labels
        *_, trial = train(model, name, *samples, rule, Clock(), test)
        return trial

    def _accuracy(self, model: Model, part: Samples) -> float:
        return accuracy(np.asarray(model.predict(part.frames)), part.labels)


def _training(
    context: Context,
    scene: Mapping[str, Any],
    split: Split,
    stop: StopRule,
    to_end: Sequence[str],
    seed: int,
) -> Training:
    """The frames of a seed, in memory."""
    sensor = context.scene(scene, seed)
    trained, tested = (
        Samples(data.take(sensor, chosen, Clock())[:], sensor.labels[chosen])
        for chosen in choose(sensor, split, seed)
    )
    return Training(sensor, trained, tested, stop, tuple(to_end))


def one_turn(training: Training, models: Mapping[str, Config]) -> Iterator[Row]:
    """Rows of the models of one way, HDC among them, trained once each."""
    beside = [training.seconds(models[HDC])]
    for name, config in models.items():
        if name != HDC:
            trained = training.carry_out(name, config)
            beside.append(training.seconds(models[HDC]))
            yield _row(name, trained, float(np.mean(beside[-2:])))
    tested = training.carry_out(HDC, models[HDC])
    tested.seconds = float(np.median([*beside, tested.seconds]))
    yield _row(HDC, tested, tested.seconds)


def _row(name: str, trained: Trained, hdc_seconds: float) -> Row:
    reached = math.isfinite(trained.seconds)
    return {
        "model": name,
        "seconds": trained.seconds if reached else None,
        "trained_s": trained.trained_s,
        "train_accuracy": trained.train_accuracy,
        "test_accuracy": trained.test_accuracy,
        "hdc_seconds": hdc_seconds,
        "status": "ok" if reached else "not reached",
    }
