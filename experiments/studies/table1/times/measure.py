"""The grid of times: every model in every implementation, timed alternately in one process.

A way is compared with itself alone: HDC by standard libraries with networks by standard libraries,
the harness's own with its own, tuned with tuned. Within a way the models train in turns, with HDC
before and after each of them, so that a ratio is one of neighbours in time. A call that is
interrupted leaves nothing behind: what is timed in turns is timed within one call.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import torch
from torch import Tensor

from experiments.protocol import data, machine
from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.protocol.clock import Clock
from experiments.protocol.data import at_seed
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.trial import Report, Test, Trial, train, untested, warm_up
from hdc.accuracy import accuracy
from scenes.frames import Scene

HDC = "hdc"
_TRIES = 3  # of each route, where the fastest of several is looked for
TO_ITS_END = StopRule(loss=0.0, most_steps=sys.maxsize, budget_s=math.inf)

Route = Mapping[str, Any]  # as a file of configs/model/ makes it
Ways = Mapping[str, Mapping[str, Mapping[str, Route]]]


@experiment(revision=1, timed=True, own_memory=True)
def times_grid(
    run: Run,
    scene: Mapping[str, Any],
    split: Split,
    stop: StopRule,
    seed: int,
    ways: Ways,
    keep_memory: Sequence[str],
    to_end: Sequence[str],
    turns: int,
    most_s: float,
) -> Iterator[Row]:
    """One row: one training of a model by a way, ``seconds`` until its training accuracy exceeds
    the target, of a model `to_end` or of one pass until it is fitted; None where it never does.

    ``route`` is the fastest of those given for the model and way; ``train_accuracy`` and
    ``test_accuracy`` are those reached; ``hdc_seconds`` the mean time of HDC by the same way just
    before and just after; in rows of HDC itself both are its median in that turn.
    Arguments: configs/experiment/times_grid.yaml.

    Raises:
        ValueError: for a way without HDC, or in a process that has kept memory for an earlier run.
    """
    _check(ways, keep_memory)
    sensor = run.scene(scene, seed)
    trained, tested = (
        Samples(data.take(sensor, chosen, Clock())[:], sensor.labels[chosen])
        for chosen in choose(sensor, split, seed)
    )
    training = Training(sensor, trained, tested, stop, tuple(to_end))
    for way, models in ways.items():
        if way in keep_memory:
            machine.keep_memory()
        routes: Any = at_seed(models, seed)
        found, fastest_of = {}, {}
        for name in models:
            found[name] = fastest(training, name, routes[name])
            fastest_of[name] = routes[name][found[name]]["model"]
            run.note(f"{way}, {name}: {found[name]}")
        for row in in_turns(training, fastest_of, turns, most_s):
            made = {"way": way, "route": found[row["model"]], **row}
            yield {"origin": sensor.origin, "seed": seed, **made}
            run.note(f"{way}, turn {row['turn']}, {row['model']}: {row['seconds']} s")


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
    """Result of one training.

    Attributes:
        seconds: until the target; infinite where it was not reached.
        train_accuracy, test_accuracy: of the model as it then was.
        steps: that it had then taken, of an optimiser.
    """

    seconds: float
    train_accuracy: float
    test_accuracy: float
    steps: float


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

    def seconds(self, config: Mapping[str, Any]) -> float:
        """Seconds in which HDC learns, not tested."""
        return self._train(self._built(config), HDC, TO_ITS_END).training_s or 0.0

    def carry_out(
        self, name: str, config: Mapping[str, Any], skip: float = 0
    ) -> Trained:
        """Train a model until its training accuracy exceeds the target, or to its end, and test it.

        Args:
            name: of the model.
            config: of the model.
            skip: steps before which it has no checkpoint: known from an earlier training, which
                the same seed repeats.
        """
        model = self._built(config)
        checkpoints = Checkpoints(self.stop.target, len(self.train.labels))

        def test(report: Report, at_end: bool) -> Report | None:
            in_one_go = name in self.to_end or "steps" not in report
            is_early = in_one_go or report["steps"] < skip
            if not at_end and (is_early or checkpoints.due(report) is not Due.ALL):
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
        seconds = (trial.training_s or 0.0) if reached else math.inf
        steps = last.get("steps", 0)
        return Trained(seconds, last["train_accuracy"], test_accuracy, steps)

    def warm_up(self, config: Mapping[str, Any]) -> None:
        """Train and predict once on noise."""
        with machine.libraries(config, torch.get_num_threads()):
            warm_up(self._built(config), self.scene.shape, len(self.train.labels))

    def _built(self, config: Mapping[str, Any]) -> Model:
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


def fastest(training: Training, name: str, routes: Mapping[str, Route]) -> str:
    """The fastest of several routes to one model, by the shortest of three trainings of each; all
    are warm afterwards."""
    for route in routes.values():
        training.warm_up(route["model"])
    if len(routes) == 1:
        return next(iter(routes))
    shortest = {}
    for called, route in routes.items():
        tries = [
            training.carry_out(name, route["model"]).seconds for _ in range(_TRIES)
        ]
        shortest[called] = min(tries)
    return min(shortest, key=lambda called: shortest[called])


def in_turns(
    training: Training,
    models: Mapping[str, Mapping[str, Any]],
    turns: int,
    most_s: float,
) -> Iterator[Row]:
    """Rows of the models of one way.

    Args:
        training: what they are trained on.
        models: their configs by name, HDC among them.
        turns: of every model, but for long ones.
        most_s: a model takes part in as many turns as it can train in so many seconds, in one at
            least.
    """
    others = [name for name in models if name != HDC]
    left = dict.fromkeys(others, turns)
    first: dict[str, Trained] = {}
    for turn in range(turns):
        taking_part = [name for name in others if turn < left[name]]
        beside = [training.seconds(models[HDC])]
        for name in taking_part:
            skip = first[name].steps if name in first else 0
            trained = training.carry_out(name, models[name], skip)
            beside.append(training.seconds(models[HDC]))
            if name not in first:
                first[name] = trained
                left[name] = _turns_of(trained.seconds, turns, most_s)
            yield _row(name, turn, trained, float(np.mean(beside[-2:])))
        tested = training.carry_out(HDC, models[HDC])
        tested.seconds = float(np.median([*beside, tested.seconds]))
        yield _row(HDC, turn, tested, tested.seconds)


def _turns_of(seconds: float, turns: int, most_s: float) -> int:
    if not math.isfinite(seconds):
        return 1
    return min(turns, max(1, int(most_s // seconds)))


def _row(name: str, turn: int, trained: Trained, hdc_seconds: float) -> Row:
    reached = math.isfinite(trained.seconds)
    return {
        "model": name,
        "turn": turn,
        "seconds": trained.seconds if reached else None,
        "train_accuracy": trained.train_accuracy,
        "test_accuracy": trained.test_accuracy,
        "hdc_seconds": hdc_seconds,
        "status": "ok" if reached else "not reached",
    }
