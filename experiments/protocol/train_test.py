"""One run: a model is trained on a scene's frames under the clock, and tested with it stopped."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text
from torch import Tensor

from baselines import library
from experiments.protocol import data
from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.protocol.clock import Clock, timed
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import Settings
from experiments.protocol.splits import choose
from experiments.protocol.trial import Report, Trial, train, warm_up
from experiments.records.run import Digests
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


def train_and_test(
    settings: Settings,
    scene: Scene,
    name: str,
    cache: Path | None,
    console: Console,
) -> Iterator[Trial]:
    """Train a model on a scene's frames under the clock, and test it.

    Args:
        settings: of the run.
        scene: where the frames come from.
        name: of the model.
        cache: folder in which frames are kept, or None.
        console: shows the progress.

    Yields:
        The trial as far as it has come: an error costs only the rest of it.

    Raises:
        ValueError: naming the key of a wrong value, or what is wrong with a model's reports.
    """
    # Errors of these are found before any frame is made.
    unused: Model = instantiate(settings.model, "model")
    check_model(unused)
    chosen = choose(scene, settings.split, settings.seed.split)
    clock = Clock(settings.device)
    if cache:
        scene = data.cached(scene, cache, console, settings.scene)
    if settings.data.pixels is not None:
        scene = data.PixelSubset(scene, settings.data.pixels, settings.seed.pixels)
    trained, tested = (
        Samples(indices, scene.labels[indices], data.take(scene, indices, clock))
        for indices in chosen
    )
    warm_up(unused, scene.shape, len(trained.labels))
    beside = _Beside(settings, scene.shape, trained)
    model: Model = instantiate(settings.model, "model")
    digests = _digests(trained, tested)
    # Without automatic refreshing: no thread draws while the clock runs.
    with Live(console=console, transient=True, auto_refresh=False) as live:

        def show(text: str) -> None:
            live.update(Text(f"train {name} {text}"), refresh=True)

        show("")
        tests = _Tests(model, trained, tested, settings.stop.target, show)
        samples = trained.frames, trained.labels
        beside.train()
        for trial in train(model, name, *samples, settings.stop, clock, tests):
            yield trial
        beside.train()
    if not trial.curve:
        raise ValueError(f"model {name}: expected at least one report, found none")
    trial = trial.having(
        **_read(trial, settings.stop.target),
        n_train=len(trained.indices),
        n_test=len(tested.indices),
        test_indices=tested.indices,
        test_labels=tested.labels,
        data_sha256=digests,
        beside_s=beside.seconds(),
    )
    yield trial
    if "train_accuracy" not in trial.curve[-1]:  # it was not tested at its end
        tests.all_frames()
    trial = trial.having(
        predicted=tests.predicted,
        test_accuracy_final=accuracy(tests.predicted, tested.labels),
        train_accuracy_final=tests.train_accuracy,
    )
    yield trial
    trial = trial.having(**_predicting(model, tested, settings.device))
    yield trial
    if _digests(trained, tested) != digests:
        raise ValueError(f"model {name}: expected it to leave its frames as they are")
    yield trial.having(model_bytes=_size(model, console))


class _Beside:
    """Other models that train on the same frames around a training: a ratio of times is one of
    neighbours in time."""

    def __init__(self, settings: Settings, shape: tuple[int, int], trained: Samples):
        self._settings, self._trained = settings, trained
        self._seconds: dict[str, list[float]] = {name: [] for name in settings.beside}
        if settings.beside and isinstance(trained.frames, data.LazyFrames):
            found = f"{len(trained.labels)} of {shape[0]} × {shape[1]} pixels"
            raise ValueError(
                f"beside: expected frames that fit in memory, found {found}"
            )
        for config in settings.beside.values():
            built = instantiate(config["model"], "model")
            warm_up(built, shape, len(trained.labels))

    def train(self) -> None:
        """Train each of them once more."""
        for name, config in self._settings.beside.items():
            model: Model = instantiate(config["model"], "model")
            clock = Clock(self._settings.device)
            samples = self._trained.frames, self._trained.labels
            *_, trial = train(model, name, *samples, self._settings.stop, clock)
            self._seconds[name].append(trial.training_s or 0.0)

    def seconds(self) -> dict[str, float]:
        """Mean seconds of each."""
        return {name: float(np.mean(times)) for name, times in self._seconds.items()}


class _Tests:
    """Tests a model at the checkpoints of its training.

    Attributes:
        predicted: classes of the test frames by the last test.
        train_accuracy: by the last test that had the training frames.
    """

    def __init__(
        self,
        model: Model,
        trained: Samples,
        tested: Samples,
        target: float,
        show: Callable[[str], None],
    ):
        self._model, self._trained, self._tested = model, trained, tested
        self._checkpoints = Checkpoints(target, len(trained.labels))
        self._show = show
        self.predicted = np.empty(0, np.int64)
        self.train_accuracy = 0.0

    def __call__(self, report: Report, at_end: bool) -> Report | None:
        due = Due.ALL if at_end else self._checkpoints.due(report)
        if due is Due.NOTHING:
            return None
        found: dict[str, float] = {}
        if np.isfinite(report.get("loss", 0.0)):
            found = self.all_frames() if due is Due.ALL else self.test_frames()
            self._show(_progress(report["training_s"], found))
        self._checkpoints.passed(report, found.get("train_accuracy"))
        return found

    def all_frames(self) -> dict[str, float]:
        """Accuracies on training and test frames."""
        predicted = np.asarray(self._model.predict(self._trained.frames))
        self.train_accuracy = accuracy(predicted, self._trained.labels)
        return {"train_accuracy": self.train_accuracy, **self.test_frames()}

    def test_frames(self) -> dict[str, float]:
        """Accuracy on the test frames."""
        self.predicted = np.asarray(self._model.predict(self._tested.frames))
        return {"test_accuracy": accuracy(self.predicted, self._tested.labels)}


def _progress(seconds: float, found: Mapping[str, float]) -> str:
    text = f"{seconds:.2f} s"
    for key, name in (("train_accuracy", "train"), ("test_accuracy", "test")):
        if key in found:
            text += f"  {name} {found[key]:.1%}"
    return text


def _digests(trained: Samples, tested: Samples) -> Digests:
    found = (data.digest(part.frames, part.labels) for part in (trained, tested))
    return Digests(*found)


def _read(trial: Trial, target: float) -> dict[str, float | None]:
    """Summary of the curve of a trial: times and accuracies where an accuracy first exceeds the
    target, and the largest accuracies."""

    def first(key: str, value: str) -> float | None:
        reached = (row[value] for row in trial.curve if row.get(key, 0.0) > target)
        return next(reached, None)

    def largest(key: str) -> float | None:
        return max((row[key] for row in trial.curve if key in row), default=None)

    return {
        "time_to_target_train_s": first("train_accuracy", "training_s"),
        "time_to_target_test_s": first("test_accuracy", "training_s"),
        "train_accuracy_at_target": first("train_accuracy", "train_accuracy"),
        "test_accuracy_at_target": first("train_accuracy", "test_accuracy"),
        "train_accuracy_max": largest("train_accuracy"),
        "test_accuracy_max": largest("test_accuracy"),
    }


def _predicting(model: Model, tested: Samples, device: str) -> dict[str, float]:
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


def _size(model: Model, console: Console) -> int | None:
    """Bytes of what a model has learnt; None where that is not known."""
    try:
        state: Any = library.state_tensors(model)
        if state is None:
            return None
        return sum(t.numel() * t.element_size() for t in state.values())
    # Any model can be asked: an error costs its size, and not its training.
    except Exception as error:
        console.print(f"model_bytes: not known, {error}", style="yellow", markup=False)
        return None
