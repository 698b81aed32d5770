"""One trial: a model trained on a scene's frames under the clock and tested with it stopped."""

from __future__ import annotations

import functools
import numbers
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
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
from experiments.protocol.model import Model, check_model, instantiate
from experiments.protocol.settings import checked
from experiments.protocol.stop import StopRule
from hdc.accuracy import accuracy
from scenes.frames import Scene

_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20
# Of a row, set by the runner.
_OWN_KEYS = {"training_s", "train_accuracy", "test_accuracy"}
# A model that learns by steps is tested after a tenth more of the samples seen.
_OFTEN = 10


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

    def accuracy(self, model: Model) -> float:
        return accuracy(model.predict(self.frames), self.labels)


def train_and_test(
    cfg: DictConfig,
    scene: Scene,
    names: Mapping[str, str],
    curve: list[dict[str, float]],
    results: dict[str, Any],
    cache: Path | None,
    console: Console,
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
    _warm_up(unused, scene, min(len(train.labels), _WARM_UP_FRAMES))
    model: Model = instantiate(cfg.model, "model")
    digests = _digests(train, test)
    # Without automatic refreshing: no thread draws while the clock runs.
    with Live(console=console, transient=True, auto_refresh=False) as live:

        def show(text: str) -> None:
            live.update(Text(f"train {names['model']} {text}"), refresh=True)

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
    predicted = np.asarray(model.predict(test.frames))
    results |= {
        "predicted": predicted,
        "test_accuracy_final": accuracy(predicted, test.labels),
        "train_accuracy_final": train.accuracy(model),
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
    due = 0.0  # samples seen at which a model is evaluated next

    def note(row: dict[str, float]) -> None:
        if np.isfinite(row.get("loss", 0.0)):
            row["train_accuracy"] = train.accuracy(model)
            row["test_accuracy"] = test.accuracy(model)
            show(
                f"{clock.seconds:.2f} s  train {row['train_accuracy']:.1%}  "
                f"test {row['test_accuracy']:.1%}"
            )
        curve.append(row)

    row: dict[str, float] = {}
    for row in reports(model, name, train.frames, train.labels, clock):
        loss, seen = row.get("loss"), row.get("samples_seen", 0)
        state = row["training_s"], row.get("steps", 0), loss
        reason = stop.check(*state)
        if reason is None and seen < due:
            continue
        note(row)
        due = _next_due(seen, loss, len(train.labels))
        if reason is None:
            reason = stop.check(*state, row.get("train_accuracy", 0.0))
        if reason is not None:
            return reason
    is_last_noted = bool(curve) and curve[-1] is row
    if row and not is_last_noted:
        note(row)
    return "finished"


def _next_due(
    seen: float,
    loss: float | None,
    n_train: int,
) -> float:
    """Samples seen at which a model is evaluated after this time.

    Testing then takes a multiple of one pass over the frames, however many reports there are; a
    model that learns by steps is tested more often, as it may exceed 90 % at any.
    """
    if loss is None:
        return min(2 * seen, n_train)
    return seen + seen / _OFTEN


def _of_curve(
    clock: Clock,
    stop: StopRule,
    reason: str,
    curve: list[dict[str, float]],
) -> dict[str, Any]:
    """Times and accuracies of a curve: at the target, and at their maxima."""
    valid = [row for row in curve if "test_accuracy" in row]

    def at_target(key: str, value: str) -> float | None:
        return next((row[value] for row in valid if row[key] > stop.target), None)

    def best(key: str) -> float | None:
        return max((row[key] for row in valid), default=None)

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
    batch = min(
        timed(functools.partial(model.predict, frames), device) for _ in range(3)
    )
    return {
        "predict_single_s": float(np.median(singles)),
        "predict_batch_s_per_frame": batch / len(frames),
    }


def _warm_up(
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
