"""The grid of times: every model by every way of computing it, timed in turns in one process.

A way is compared with itself alone: HDC by standard libraries with networks by standard libraries,
the harness's own with its own, tuned with tuned. Within a way the models train in turns, with HDC
before and after each of them, so that a ratio is one of neighbours in time. A call that is
interrupted leaves nothing behind: what is timed in turns is timed within one call.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from torch import Tensor

from experiments.protocol import data, machine
from experiments.protocol.clock import Clock
from experiments.protocol.data import at_seed
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.looks import Look, Looks
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.stop import StopRule
from experiments.protocol.trial import reports, stop_rule, warm_up
from hdc.accuracy import accuracy
from scenes.frames import Scene

HDC = "hdc"
_TRIES = 3  # of each route, where the fastest of several is looked for
_WARM_UP_FRAMES = 40

Route = Mapping[str, Any]  # as a file of configs/model/ makes it
Ways = Mapping[str, Mapping[str, Mapping[str, Route]]]


@experiment(revision=1, timed=True, own_memory=True)
def times_grid(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    stop: Mapping[str, Any],
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
    train, test = (
        Samples(data.take(sensor, chosen, Clock())[:], sensor.labels[chosen])
        for chosen in data.choose(sensor, split, seed)
    )
    rule = stop_rule(OmegaConf.create(dict(stop)))
    training = Training(sensor, train, test, rule, tuple(to_end))
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
    """What came of one training.

    Attributes:
        seconds: until the target; infinite where it was not reached.
        train_accuracy, test_accuracy: of the model as it then was.
        reports: how many it had made.
    """

    seconds: float
    train_accuracy: float
    test_accuracy: float
    reports: int


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
        model, clock = self._built(config), Clock()
        for _ in reports(model, HDC, self.train.frames, self.train.labels, clock):
            pass
        return clock.seconds

    def carry_out(self, name: str, config: Mapping[str, Any], skip: int = 0) -> Trained:
        """Train a model until its training accuracy exceeds the target, or to its end, and test it.

        Args:
            name: of the model.
            config: of the model.
            skip: reports before which it is not looked at: known from an earlier training, which
                the same seed repeats.
        """
        model, clock = self._built(config), Clock()
        looks = Looks(self.stop.target, len(self.train.labels))
        count, fitted = 0, True
        with machine.libraries(config, torch.get_num_threads()):
            samples = self.train.frames, self.train.labels
            for report in reports(model, name, *samples, clock):
                count += 1
                if name in self.to_end or "steps" not in report:
                    continue
                fitted = False
                look = looks.at(report)
                if count >= skip and look is Look.ALL:
                    share = self._share(model, self.train)
                    looks.looked(report, share)
                    fitted = share > self.stop.target
                state = clock.seconds, report["steps"], report.get("loss")
                if fitted or self.stop.check(*state):
                    break
            train_accuracy = self._share(model, self.train)
            test_accuracy = self._share(model, self.test)
        seconds = clock.seconds if fitted else math.inf
        return Trained(seconds, train_accuracy, test_accuracy, count)

    def warm_up(self, config: Mapping[str, Any]) -> None:
        """Train and predict once on noise."""
        n = min(len(self.train.labels), _WARM_UP_FRAMES)
        with machine.libraries(config, torch.get_num_threads()):
            warm_up(self._built(config), self.scene, n)

    def _built(self, config: Mapping[str, Any]) -> Model:
        model: Model = instantiate(OmegaConf.create(dict(config)), "task.ways")
        check_model(model)
        return model

    def _share(self, model: Model, part: Samples) -> float:
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
            skip = first[name].reports if name in first else 0
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
