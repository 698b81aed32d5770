"""One trial: a model trained on a scene's frames under the clock and tested with it stopped."""

from __future__ import annotations

import functools
import numbers
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.live import Live
from rich.text import Text
from torch import Tensor

from experiments.protocol import data
from experiments.protocol.clock import Clock, timed
from experiments.protocol.looks import Look, Looks
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import checked
from experiments.protocol.stop import StopRule
from hdc.accuracy import accuracy
from scenes.frames import Scene

_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20
# Of a row, set by the runner.
_OWN_KEYS = {"training_s", "train_accuracy", "test_accuracy"}
_BATCH_TIMES = 3  # of a prediction in a batch, of which the shortest counts …
_LONG_S = 1.0  # … fewer where they take this long


def stop_rule(node: DictConfig) -> StopRule:
    """The stopping rule of the config.

    Raises:
        ValueError: naming a key that it does not have, or whose value is out of range.
    """
    return checked(OmegaConf.to_container(node, resolve=True), StopRule, "stop")


@dataclass
class _Part:
    """The training or the test samples."""

    indices: np.ndarray
    labels: np.ndarray
    frames: Tensor | data.LazyFrames
    predicted: np.ndarray = field(
        default_factory=lambda: np.empty(0)
    )  # at the last look

    def accuracy(self, model: Model) -> float:
        """Test the model."""
        self.predicted = np.asarray(model.predict(self.frames))
        return accuracy(self.predicted, self.labels)


def train_and_test(
    cfg: DictConfig,
    scene: Scene,
    names: Mapping[str, str],
    curve: list[dict[str, float]],
    results: dict[str, Any],
    cache: Path | None,
    console: Console,
    about: str = "",
) -> None:
    """Train on a scene's frames under the clock, test, and leave the results to be recorded.

    Args:
        cfg: the composed config.
        scene: where the frames come from.
        names: which file of each group the config was composed from.
        curve: gets one row a report of the model.
        results: gets times, accuracies and predictions, part by part: an error costs the rest.
        cache: folder in which frames are kept, or None.
        console: shows the progress.
        about: what stands before it.

    Raises:
        ValueError: naming the key of a wrong value, or what is wrong with a model's reports.
    """
    # Errors of these are found before any frame is made.
    stop = stop_rule(cfg.stop)
    unused: Model = instantiate(cfg.model, "model")
    check_model(unused)
    split = OmegaConf.to_container(cfg.split, resolve=True)
    chosen = data.choose(scene, split, cfg.seed.split)
    clock = Clock(cfg.device)
    if cache:
        scene = data.cached(scene, cache, console)
    if cfg.data.pixels is not None:
        scene = data.PixelSubset(scene, cfg.data.pixels, cfg.seed.pixels)
    train, test = (
        _Part(indices, scene.labels[indices], data.take(scene, indices, clock))
        for indices in chosen
    )
    warm_up(unused, scene, min(len(train.labels), _WARM_UP_FRAMES))
    model: Model = instantiate(cfg.model, "model")
    digests = _digests(train, test)
    # Without automatic refreshing: no thread draws while the clock runs.
    with Live(console=console, transient=True, auto_refresh=False) as live:

        def show(text: str) -> None:
            live.update(Text(f"{about}train {names['model']} {text}"), refresh=True)

        show("")
        reason = _train(model, names["model"], train, test, clock, stop, curve, show)
    if not curve:
        raise ValueError(
            f"model {names['model']}: expected at least one report, found none"
        )
    results |= _of_curve(clock, stop, reason, curve)
    results |= {
        "n_train": len(train.indices),
        "n_test": len(test.indices),
        "test_indices": test.indices,
        "test_labels": test.labels,
        "data_sha256": digests,
    }
    if "train_accuracy" not in curve[-1]:  # it was not tested at its end
        train.accuracy(model)
        test.accuracy(model)
    results |= {
        "predicted": test.predicted,
        "test_accuracy_final": accuracy(test.predicted, test.labels),
        "train_accuracy_final": accuracy(train.predicted, train.labels),
    }
    results |= _prediction_times(model, test, cfg.device)
    if _digests(train, test) != digests:
        raise ValueError(
            f"model {names['model']}: expected it to leave its frames as they are"
        )
    results["model_bytes"] = _size(model, console)


def _size(model: Model, console: Console) -> int | None:
    """Bytes of what a model has learnt; None where that is not known."""
    try:
        state = model.state_tensors()
        if state is None:
            return None
        return sum(t.numel() * t.element_size() for t in state.values())
    # Of whatever model: an error costs its size, and not its training.
    except Exception as error:
        console.print(f"model_bytes: not known, {error}", style="yellow", markup=False)
        return None


def _digests(train: _Part, test: _Part) -> dict[str, str]:
    parts = (("train", train), ("test", test))
    return {name: data.digest(part.frames, part.labels) for name, part in parts}


def reports(
    model: Model,
    name: str,
    frames: Any,
    labels: np.ndarray,
    clock: Clock,
) -> Iterator[dict[str, float]]:
    """Train a model under the clock; yields each of its reports with ``training_s``, clock stopped.

    Raises:
        ValueError: for a report that is not made of numbers, or has a key of the runner's own.
    """
    with clock.running():
        iterator = iter(model.train(frames, labels))
    while True:
        with clock.running():
            report = next(iterator, None)
        if report is None:
            return
        for key, value in report.items():
            place = f"model {name}: report[{key!r}]"
            if key in _OWN_KEYS:
                raise ValueError(f"{place}: expected no such key")
            if not isinstance(value, numbers.Real) or isinstance(value, bool):
                raise ValueError(f"{place}: expected a number, found {value!r}")
        yield {"training_s": clock.seconds, **report}


def _train(
    model: Model,
    name: str,
    train: _Part,
    test: _Part,
    clock: Clock,
    stop: StopRule,
    curve: list[dict[str, float]],
    show: Callable[[str], None],
) -> str:
    """Train under the clock, evaluate with the clock stopped; returns the name of the stop."""
    looks = Looks(stop.target, len(train.labels))

    def note(row: dict[str, float], look: Look) -> None:
        if np.isfinite(row.get("loss", 0.0)):
            if look is Look.ALL:
                row["train_accuracy"] = train.accuracy(model)
            row["test_accuracy"] = test.accuracy(model)
            show(_progress(clock.seconds, row))
        curve.append(row)
        looks.looked(row, row.get("train_accuracy"))

    row: dict[str, float] = {}
    for row in reports(model, name, train.frames, train.labels, clock):
        state = row["training_s"], row.get("steps", 0), row.get("loss")
        reason = stop.check(*state)
        look = looks.at(row) if reason is None else Look.ALL
        if look is Look.NOTHING:
            continue
        note(row, look)
        if reason is None:
            reason = stop.check(*state, row.get("train_accuracy", 0.0))
        if reason is not None:
            return reason
    is_last_noted = bool(curve) and curve[-1] is row
    if row and not is_last_noted:
        note(row, Look.ALL)
    return "finished"


def _progress(seconds: float, row: Mapping[str, float]) -> str:
    text = f"{seconds:.2f} s"
    for key, name in (("train_accuracy", "train"), ("test_accuracy", "test")):
        if key in row:
            text += f"  {name} {row[key]:.1%}"
    return text


def _of_curve(
    clock: Clock,
    stop: StopRule,
    reason: str,
    curve: list[dict[str, float]],
) -> dict[str, Any]:
    """Times and accuracies of a curve: at the target, and at their maxima."""
    valid = [row for row in curve if "test_accuracy" in row]

    def at_target(key: str, value: str) -> float | None:
        reached = (row[value] for row in valid if row.get(key, 0.0) > stop.target)
        return next(reached, None)

    def best(key: str) -> float | None:
        return max((row[key] for row in valid if key in row), default=None)

    return {
        "stop": reason,
        "training_s": clock.seconds,
        "time_to_target_train_s": at_target("train_accuracy", "training_s"),
        "time_to_target_test_s": at_target("test_accuracy", "training_s"),
        "train_accuracy_at_target": at_target("train_accuracy", "train_accuracy"),
        "test_accuracy_at_target": at_target("train_accuracy", "test_accuracy"),
        "train_accuracy_max": best("train_accuracy"),
        "test_accuracy_max": best("test_accuracy"),
    }


def _prediction_times(
    model: Model,
    test: _Part,
    device: str,
) -> dict[str, float]:
    """Seconds a frame, single and in a batch, of frames in memory."""
    frames = test.frames[: data.fitting(test.frames)]
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


def warm_up(
    model: Model,
    scene: Scene,
    n: int,
) -> None:
    """Train and predict once on noise of the same shape: the first use of anything is slow."""
    generator = torch.Generator().manual_seed(0)
    frames = torch.randint(
        0, 256, (n, *scene.shape), generator=generator, dtype=torch.uint8
    )
    next(iter(model.train(frames, np.arange(n) % 2)), None)
    model.predict(frames[:2])
