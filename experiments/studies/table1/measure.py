"""Training times on the frames of Table I, with what else the machine did beside them.

A model is trained again and again in groups of a few seconds, over which the load of the machine is
measured; HDC in a group before and after each other model.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
import torch
from msgspec import Meta
from torch import Tensor

from experiments.protocol import data, machine
from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.protocol.clock import Clock
from experiments.protocol.load import Limits, Load, Retries, Watch
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import Seed, Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.protocol.trial import Report, train, warm_up
from experiments.records.files import ROOT
from experiments.studies.table1 import cold
from hdc.accuracy import accuracy

HDC = "hdc"
COLD, NOT_REACHED = "a process of its own", "stopped before the training accuracy"
_SPIN = """
import sys, time
while True:
    end = time.perf_counter() + 0.02 * float(sys.argv[1])
    while time.perf_counter() < end: pass
    time.sleep(0.02 * (1 - float(sys.argv[1])))
"""

Config = Mapping[str, Any]  # as a file of configs/model/ makes it


class Again(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """``retries``: how often a disturbed group is measured again, and for how long in all."""

    most: Annotated[int, Meta(ge=0)]
    budget_s: float


class Times(Task, frozen=True):
    """One row: one fit of a model, ``fit_s`` until its training accuracy exceeds the target, of one
    that learns in one pass or is solved until it is done; ``cpu_s`` of the processor.

    Fits of one ``group`` follow each other. ``others`` and ``yardstick_…`` are the load beside the
    group, and ``disturbed`` is the reason why its fits do not count, or empty. A fit that is
    ``cold`` is a process of its own: all of its seconds, from its start to its end.

    Attributes:
        seed: of the frames and of the models.
        measurement: 1, and 2 for that some hours later.
        models: as files of configs/model/ make them, with HDC among them.
        threads: numbers of threads.
        only: numbers of threads of models that are not timed with all of them.
        group_s: seconds that a group takes at least.
        fits: of a model, at least; at least as many as it says here of those in `fewer`.
        disturbed: from which load on a group counts as disturbed.
        retries: of disturbed groups.
        cold: models that are trained in a process of their own; each ends by itself.
        busy: how many cores other processes keep busy meanwhile, one value after the other.
    """

    timed: ClassVar = True

    scene: Config
    split: Split
    stop: StopRule
    seed: Seed
    measurement: int
    models: Mapping[str, Config]
    threads: Sequence[int]
    only: Mapping[str, Sequence[int]]
    group_s: float
    fits: Annotated[int, Meta(ge=1)]
    fewer: Mapping[str, int]
    disturbed: Limits
    retries: Again
    cold: Sequence[str]
    busy: Sequence[float]

    def __post_init__(self) -> None:
        if HDC not in self.models:
            found = ", ".join(self.models)
            raise ValueError(f"models: expected {HDC} among them, found {found}")

    def rows(self, context: Context) -> Iterator[Row]:
        scene = context.scene(self.scene, self.seed)
        chosen, _ = choose(scene, self.split, self.seed)
        samples = Samples(data.take(scene, chosen, Clock())[:], scene.labels[chosen])
        cores = len(machine.available())
        threads = [n for n in self.threads if n <= cores]
        timing = _Timing(self, samples, Watch(tuple(threads)))
        before = torch.get_num_threads()
        try:
            for share in self.busy:
                for n in threads:
                    torch.set_num_threads(n)
                    with busy(share):
                        for row in timing.rows(n):
                            yield {"origin": scene.origin, "busy": share, **row}
                    context.note(f"{n} threads, {share:g} cores busy")
        finally:
            torch.set_num_threads(before)

    def order(self, threads: int) -> list[str]:
        """Models in the order of their groups: HDC before and after each other."""
        found = [HDC]
        for name in self.models:
            if name != HDC and threads in self.only.get(name, self.threads):
                found += [name, HDC]
        return found


@dataclass(frozen=True)
class Samples:
    """Frames in memory uint8 [N, H, W] and their labels int64 [N]."""

    frames: Tensor
    labels: np.ndarray


class _Timing:
    """Times the models of a task.

    Args:
        task: says how.
        samples: of the training.
        watch: measures the load.
    """

    def __init__(self, task: Times, samples: Samples, watch: Watch) -> None:
        self._task, self._samples, self._watch = task, samples, watch
        self._retries = Retries(task.retries.most, task.retries.budget_s)
        self._groups = count()

    def rows(self, threads: int) -> Iterator[Row]:
        """A row per fit of each model."""
        order = self._task.order(threads)
        for name in dict.fromkeys(order):
            config = self._task.models[name]["model"]
            _, *shape = self._samples.frames.shape
            warm_up(_built(config), (shape[0], shape[1]), len(self._samples.labels))
        for name in order:
            for row in self._of_model(name):
                yield {"model": name, "threads": threads, "cold": False, **row}
        for name in self._task.cold:
            model = self._task.models[name]["model"]
            for row in self._measured(partial(self._cold, model, threads)):
                row["disturbed"] = row["disturbed"] or COLD
                yield {"model": name, "threads": threads, "cold": True, **row}

    def _of_model(self, name: str) -> Iterator[Row]:
        """Groups until there are as many fits as the task asks for."""
        config = self._task.models[name]["model"]
        missing = self._task.fewer.get(name, self._task.fits)
        while missing > 0:
            rows = list(self._measured(partial(self._group, config)))
            last = rows[-1]["attempt"]  # which stands
            missing -= sum(row["attempt"] == last for row in rows)
            yield from rows

    def _measured(self, work: Callable[[], list[Row]]) -> Iterator[Row]:
        """The rows of all attempts at the fits of a group, with the load beside them."""
        limits = self._task.disturbed

        def measure(_: int) -> tuple[list[Row], Load]:
            with self._watch.watching():
                fits = work()
            return fits, self._watch.load

        attempts = self._retries.attempts(measure, lambda each: limits.reason(each[1]))
        for attempt, (fits, load) in enumerate(attempts):
            about = {"group": next(self._groups), "attempt": attempt}
            for one in fits:
                yield {**about, **limits.columns(load), **one}

    def _group(self, config: Config) -> list[Row]:
        fits: list[Row] = []
        start = time.perf_counter()
        while not fits or time.perf_counter() - start < self._task.group_s:
            fits.append(fit(config, self._samples, self._task.stop))
        return fits

    def _cold(self, config: Config, threads: int) -> list[Row]:
        """One fit in a process of its own, with all of its seconds."""
        frames, labels = self._samples.frames, self._samples.labels
        with tempfile.TemporaryDirectory() as folder:
            cold.keep(Path(folder), frames, labels, config, threads)
            command = [sys.executable, "-m", cold.__name__, folder]
            threaded = {**os.environ, "OMP_NUM_THREADS": str(threads)}
            used, start = _seconds_of_children(), time.perf_counter()
            subprocess.run(command, cwd=ROOT, env=threaded, check=True)
            took = time.perf_counter() - start
        return [{"fit_s": took, "cpu_s": _seconds_of_children() - used}]


def fit(config: Config, samples: Samples, stop: StopRule) -> Row:
    """Train a model once: its seconds and its training accuracy. One that learns by steps and does
    not exceed the target is disturbed."""
    model, clock = _built(config), Clock()
    checkpoints = Checkpoints(stop.target, len(samples.labels))

    def test(report: Report, at_end: bool) -> Report | None:
        by_steps = "steps" in report
        if not at_end and not (by_steps and checkpoints.due(report) is Due.ALL):
            return None
        predicted = np.asarray(model.predict(samples.frames))
        share = accuracy(predicted, samples.labels)
        checkpoints.passed(report, share)
        return {"train_accuracy": share}

    rule = msgspec.structs.replace(stop, reached_after_s=0.0)
    *_, trial = train(model, "", samples.frames, samples.labels, rule, clock, test)
    last = trial.curve[-1]
    share = last["train_accuracy"]
    found: Row = {"fit_s": clock.seconds, "cpu_s": clock.cpu_s, "train_accuracy": share}
    if "steps" in last and share <= stop.target:
        found["disturbed"] = NOT_REACHED
    return found


def _built(config: Config) -> Model:
    model: Model = instantiate(config, "model")
    check_model(model)
    return model


def _seconds_of_children() -> float:
    times = os.times()
    return times.children_user + times.children_system


@contextmanager
def busy(cores: float) -> Iterator[None]:
    """Other processes keep so many cores busy, the last of them a part of the time."""
    with ExitStack() as stack:
        while cores > 0:
            command = [sys.executable, "-c", _SPIN, str(min(1.0, cores))]
            process = stack.enter_context(subprocess.Popen(command))
            stack.callback(process.kill)
            cores -= 1
        yield
