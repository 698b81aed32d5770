"""A training as a task: a model learns on a scene's frames under the clock, and is tested."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Generator, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from rich.live import Live
from torch import Tensor

from baselines import library
from experiments.protocol import data
from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.protocol.clock import Clock, timed
from experiments.protocol.load import Limits, Watch
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import Data, Seeds, Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.protocol.trial import Report, Trial, train, warm_up
from experiments.records.rows import pack_labels
from hdc.accuracy import accuracy
from scenes.frames import Scene

_SINGLE_FRAMES = 20
_BATCH_TIMES = 3  # of a prediction in a batch, of which the shortest counts …
_LONG_S = 1.0  # … fewer where they take this long


@dataclass(frozen=True)
class Samples:
    """The training or the test samples: indices int64 [N], labels int64 [N] and frames."""

    indices: np.ndarray
    labels: np.ndarray
    frames: Tensor | data.LazyFrames

    @property
    def digest(self) -> str:
        """SHA-256 of frames and labels."""
        return data.digest(self.frames, self.labels)


class Training(Task, frozen=True, kw_only=True, dict=True, forbid_unknown_fields=False):
    """Trains one model on the frames of a scene. A row is a checkpoint of the training: what the
    model reported, ``training_s`` and the accuracies, as far as it was tested there. The last row
    has the results.

    ============================ ===================================================================
    ``stop``                     why it ended, one of :data:`experiments.protocol.stop.NAMES`
    ``training_time_s``          in the paper's sense: of a model that learns by steps until its
                                 training accuracy exceeded the target (None if it never did), of
                                 one that is solved, or learns in one pass, until it is done
    ``total_time_s``             of the whole training
    ``beside.NAME_s``            of other models on the same frames: the mean of one training just
                                 before and one just after
    ``load.disturbed``           where the config has limits of a load: why the times do not count,
                                 or empty; the others of ``load`` are what was measured
    ``…_at_target``              when training accuracy first exceeded the target
    ``model_bytes``              size of what was learnt; None where it is not known
    ``test_set``                 SHA-256 of the test frames and their labels
    ``labels``, ``predicted``    true classes of the test samples, and by the last model
    ============================ ===================================================================
    """

    timed: ClassVar[bool] = True

    scene: dict[str, Any]
    model: dict[str, Any]
    stop: StopRule
    split: Split
    data: Data
    seed: Seeds
    device: Any = "cpu"
    beside: dict[str, dict[str, Any]]
    disturbed: Limits | None = None

    @functools.cached_property
    def built(self) -> Scene:
        """The scene."""
        built: Scene = instantiate(self.scene, "scene")
        return built

    def fingerprint(self) -> str:
        """Digest of the scene's frames."""
        return self.built.fingerprint()

    def rows(self, context: Context) -> Iterator[Row]:
        """Its checkpoints, and its results.

        Raises:
            ValueError: naming the key of a wrong value, or what is wrong with a model's reports.
        """
        # A wrong model is found before any frame is made.
        unused: Model = instantiate(self.model, "model")
        check_model(unused)
        clock = Clock(self.device)
        trained, tested = self._samples(context, clock)
        self._warm_up(unused, trained)
        model: Model = instantiate(self.model, "model")
        tests = _Tests(model, trained, tested, self.stop.target)
        digests = trained.digest, tested.digest
        watch = Watch() if self.disturbed else None
        with watch.watching() if watch else nullcontext():
            before = self._beside(trained)
            trial = yield from self._curve(context, model, trained, clock, tests)
            after = self._beside(trained)
        results = {
            **self._of_frames(trained, tested),
            **_of_trial(trial, self.stop.target),
            **{key: (before[key] + after[key]) / 2 for key in before},
            **self._load(watch),
            **tests.results(),
            **_predicting(model, tested, self.device),
            "test_set": digests[1],
            "model_bytes": _size(model),
        }
        if (trained.digest, tested.digest) != digests:
            expected = "expected it to leave its frames as they are"
            raise ValueError(f"model {context.name}: {expected}")
        yield results

    def _curve(
        self,
        context: Context,
        model: Model,
        trained: Samples,
        clock: Clock,
        tests: _Tests,
    ) -> Generator[Row, None, Trial]:
        """Train the model and yield its checkpoints; the trial."""
        name, trial = context.name, Trial()
        samples = trained.frames, trained.labels
        # Without automatic refreshing: no thread draws while the clock runs.
        with Live(console=context.console, transient=True, auto_refresh=False) as live:
            live.update(f"train {name}", refresh=True)
            known = 0
            for trial in train(model, name, *samples, self.stop, clock, tests):
                yield from trial.curve[known:]
                known = len(trial.curve)
                live.update(f"train {name} {clock.seconds:.2f} s", refresh=True)
        if not trial.curve:
            raise ValueError(f"model {name}: expected at least one report, found none")
        return trial

    def _load(self, watch: Watch | None) -> Row:
        """The load of the machine, where the config has limits of it."""
        if self.disturbed is None or watch is None:
            return {}
        load = self.disturbed.columns(watch.load)
        return {f"load.{key}": value for key, value in load.items()}

    def _warm_up(self, unused: Model, trained: Samples) -> None:
        """Use each model once; one whose size cannot be asked fails here, before its training."""
        n, height, width = trained.frames.shape
        beside = [instantiate(part["model"], "model") for part in self.beside.values()]
        for model in (*beside, unused):
            warm_up(model, (height, width), n)
        _size(unused)

    def _beside(self, trained: Samples) -> dict[str, float]:
        """Train the models beside this one on the same frames; their seconds. They are trained
        before and after, so that a ratio of times is one of neighbours in time."""
        seconds = {}
        if self.beside and isinstance(trained.frames, data.LazyFrames):
            raise ValueError("beside={}: frames that exceed the memory need it")
        for name, part in self.beside.items():
            model: Model = instantiate(part["model"], "model")
            clock, samples = Clock(self.device), (trained.frames, trained.labels)
            *_, trial = train(model, name, *samples, self.stop, clock)
            seconds[f"beside.{name}_s"] = trial.training_s or 0.0
        return seconds

    def _samples(self, context: Context, clock: Clock) -> Iterator[Samples]:
        """The training and the test samples."""
        scene, chosen = self.built, choose(self.built, self.split, self.seed.split)
        if context.cache:
            scene = data.cached(scene, self.scene, context.console)
        if self.data.pixels is not None:
            scene = data.pixel_subset(scene, self.data.pixels, self.seed.pixels)
        for indices in chosen:
            frames = data.take(scene, indices, clock)
            yield Samples(indices, scene.labels[indices], frames)

    def _of_frames(self, trained: Samples, tested: Samples) -> Row:
        scene = self.built
        return {
            "origin": scene.origin,
            "classes": json.dumps(list(scene.classes)),
            "n_classes": len(scene.classes),
            "n_pixels": math.prod(scene.shape),
            "n_train": len(trained.indices),
            "n_test": len(tested.indices),
            "test_indices": pack_labels(tested.indices),
            "labels": pack_labels(tested.labels),
        }


class _Tests:
    """Tests a model at the checkpoints of its training."""

    def __init__(
        self,
        model: Model,
        trained: Samples,
        tested: Samples,
        target: float,
    ):
        self._model, self._trained, self._tested = model, trained, tested
        self._checkpoints = Checkpoints(target, len(trained.labels))
        self._predicted = np.empty(0, np.int64)
        self._last: Report = {}

    def __call__(self, report: Report, at_end: bool) -> Report | None:
        due = Due.ALL if at_end else self._checkpoints.due(report)
        if due is Due.NOTHING:
            return None
        self._last = {}
        if np.isfinite(report.get("loss", 0.0)):
            self._test(due)
        self._checkpoints.passed(report, self._last.get("train_accuracy"))
        return self._last

    def _test(self, due: Due) -> None:
        """Accuracies on the test frames, and on the training frames if they are due."""
        self._last = {}
        if due is Due.ALL:
            predicted = np.asarray(self._model.predict(self._trained.frames))
            self._last["train_accuracy"] = accuracy(predicted, self._trained.labels)
        self._predicted = np.asarray(self._model.predict(self._tested.frames))
        self._last["test_accuracy"] = accuracy(self._predicted, self._tested.labels)

    def results(self) -> Row:
        """The accuracies at the end of the training, and the predictions."""
        if "train_accuracy" not in self._last:  # it was not tested at its end
            self._test(Due.ALL)
        return {
            "train_accuracy_final": self._last["train_accuracy"],
            "test_accuracy_final": self._last["test_accuracy"],
            "right": int((self._predicted == self._tested.labels).sum()),
            "predicted": pack_labels(self._predicted),
        }


def _of_trial(trial: Trial, target: float) -> Row:
    """Results of the curve of a trial: when its training accuracy first exceeded the target."""
    curve, seconds = trial.curve, trial.training_s
    iterative = any("loss" in row for row in curve)
    passed = (row for row in curve if row.get("train_accuracy", 0.0) > target)
    at_target: Report = next(passed, {})
    # A solver that goes to the optimum makes one report, without steps of an optimiser.
    solved = len(curve) == 1 and "steps" not in curve[0] and trial.stop == "finished"
    if iterative and (at_target or not solved):
        seconds = at_target.get("training_s")
    return {
        "stop": trial.stop,
        "iterative": iterative,
        "training_time_s": seconds,
        "total_time_s": trial.training_s,
        "train_accuracy_at_target": at_target.get("train_accuracy"),
        "test_accuracy_at_target": at_target.get("test_accuracy"),
    }


def _predicting(model: Model, tested: Samples, device: str) -> Row:
    """Seconds of predicting a frame, single and in a batch, in memory."""
    frames = tested.frames[: data.fitting(tested.frames)]
    singles = [
        timed(functools.partial(model.predict, frames[i : i + 1]), device)
        for i in range(min(_SINGLE_FRAMES, len(frames)))
    ]
    batches: list[float] = []
    while len(batches) < _BATCH_TIMES and sum(batches) < _LONG_S:
        batches.append(timed(functools.partial(model.predict, frames), device))
    return {
        "predict_single_s": float(np.median(singles)),
        "predict_batch_s_per_frame": min(batches) / len(frames),
    }


def _size(model: Model) -> int | None:
    """Bytes of what a model has learnt; None where that is not known."""
    state = library.state_tensors(model)
    if state is None:
        return None
    return sum(t.numel() * t.element_size() for t in state.values())
