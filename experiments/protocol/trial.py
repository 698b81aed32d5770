"""One trial: a model trained on a scene's frames under the clock and tested with it stopped."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from torch import Tensor

from experiments.protocol import data, evaluate
from experiments.protocol.clock import Clock, timed
from experiments.protocol.model import Model
from experiments.protocol.stop import StopRule
from scenes.frames import Scene

_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20
_OFTEN = 10  # a model that learns by steps is tested after a tenth more of the samples seen


def instantiate(node: DictConfig, key: str) -> Any:
    """Build an object of the config; an error of its own names the key and keeps its message."""
    try:
        return hydra.utils.instantiate(node, _convert_="all")
    except hydra.errors.InstantiationException as error:
        cause = error.__cause__
        if not isinstance(cause, ValueError | TypeError | OSError):
            raise
        text = str(cause)
        raise ValueError(text if text.startswith(f"{key}.") else f"{key}: {text}") from error


def stop_rule(node: DictConfig) -> StopRule:
    """The stopping rule of the config.

    Raises:
        ValueError: naming a key that it does not have.
    """
    known = [field.name for field in fields(StopRule)]
    if unknown := sorted(set(map(str, node)) - set(known)):
        raise ValueError(f"stop.{unknown[0]}: expected one of {', '.join(known)}")
    values: Any = OmegaConf.to_container(node, resolve=True)
    return StopRule(**values)


@dataclass
class _Part:
    """The training or the test samples."""

    indices: np.ndarray
    labels: np.ndarray
    frames: Tensor | data.LazyFrames

    def accuracy(self, model: Model) -> float:
        return evaluate.accuracy(model.predict(self.frames), self.labels)


def train_and_test(
    cfg: DictConfig,
    scene: Scene,
    names: Mapping[str, str],
    curve: list[dict[str, float]],
    results: dict[str, Any],
    cache: Path | None,
    console: Console,
) -> None:
    """Everything between the scene and the record.

    Args:
        cfg: the composed config.
        scene: where the frames come from.
        names: which file of each group the config was composed from.
        curve: gets one row a report of the model, whatever happens later.
        results: gets what the record holds of the model's times, accuracies and predictions, part
            by part, so that an error after the training costs none of it.
        cache: folder in which frames are kept, or None.
        console: shows the progress.
    """
    # Whatever is wrong with these is found before any frame is made.
    stop = stop_rule(cfg.stop)
    unused: Model = instantiate(cfg.model, "model")
    split = OmegaConf.to_container(cfg.split, resolve=True)
    chosen = data.choose(scene, split, cfg.seed.split)
    clock = Clock(cfg.device)
    with _progress(console) as progress:
        if cache:
            scene = _cached(scene, cache, progress, names["scene"])
        if cfg.data.pixels is not None:
            scene = data.PixelSubset(scene, cfg.data.pixels, cfg.seed.pixels)
        train, test = (
            _Part(indices, scene.labels[indices], data.take(scene, indices, clock))
            for indices in chosen
        )
        _warm_up(unused, scene, min(len(train.labels), _WARM_UP_FRAMES))
        model: Model = instantiate(cfg.model, "model")
        bar = progress.add_task(f"train {names['model']}", total=None)

        def show(text: str) -> None:
            progress.update(bar, description=f"train {names['model']} {text}", refresh=True)

        reason = _train(model, train, test, clock, stop, curve, show)
    if not curve:
        raise ValueError(f"model {names['model']}: expected at least one report, found none")
    results |= _of_curve(clock, stop, reason, curve)
    results |= {
        "n_train": len(train.indices),
        "n_test": len(test.indices),
        "test_indices": test.indices,
        "test_labels": test.labels,
        "data_sha256": {
            name: data.digest(part.frames, part.labels)
            for name, part in (("train", train), ("test", test))
        },
    }
    results |= _predictions(model, train, test)
    results |= _prediction_times(model, test, cfg.device)
    try:
        results["model_bytes"] = model_bytes(model)
    except Exception as error:  # of whatever model: it costs its size, and not its training
        console.print(f"model_bytes: not known, {error}", style="yellow", markup=False)
        results["model_bytes"] = None


def _train(
    model: Model,
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

    with clock.running():
        reports = iter(model.train(train.frames, train.labels))
    row: dict[str, float] = {}
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            if row and (not curve or curve[-1] is not row):
                note(row)
            return "finished"
        row = {"training_s": clock.seconds, **report}
        loss, seen = row.get("loss"), row.get("samples_seen", 0)
        state = clock.seconds, row.get("steps", 0), loss
        name = stop.check(*state)
        if name is None and seen < due:
            continue
        note(row)
        # Testing then takes a multiple of one pass over the frames, however many reports there are;
        # a model that learns by steps is tested more often, as it may exceed 90 % at any.
        due = min(2 * seen, len(train.labels)) if loss is None else seen + seen / _OFTEN
        if name := name or stop.check(*state, row.get("train_accuracy", 0.0)):
            return name


def _of_curve(
    clock: Clock, stop: StopRule, reason: str, curve: list[dict[str, float]]
) -> dict[str, Any]:
    """What the curve says."""
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


def _predictions(model: Model, train: _Part, test: _Part) -> dict[str, Any]:
    """The final model on the test samples, and its accuracy on the training samples."""
    predicted = np.asarray(model.predict(test.frames))
    return {
        "predicted": predicted,
        "test_accuracy_final": evaluate.accuracy(predicted, test.labels),
        "train_accuracy_final": train.accuracy(model),
    }


def _prediction_times(model: Model, test: _Part, device: str) -> dict[str, float]:
    """Seconds a frame, single and in a batch, of frames in memory."""
    singles = [
        timed(functools.partial(model.predict, test.frames[i : i + 1]), device)
        for i in range(min(_SINGLE_FRAMES, len(test.labels)))
    ]
    frames = test.frames[: data.fitting(test.frames)]
    batch = min(timed(functools.partial(model.predict, frames), device) for _ in range(3))
    return {
        "predict_single_s": float(np.median(singles)),
        "predict_batch_s_per_frame": batch / len(frames),
    }


def model_bytes(model: Model) -> int | None:
    """Size of what a model has learnt; None where it cannot tell."""
    try:
        state = model.state_tensors()
    except TypeError:  # not arrays
        return None
    return None if state is None else sum(t.numel() * t.element_size() for t in state.values())


def _warm_up(model: Model, scene: Scene, n: int) -> None:
    """Train and predict once on noise of the same shape: the first use of anything is slow."""
    generator = torch.Generator().manual_seed(0)
    frames = torch.randint(0, 256, (n, *scene.shape), generator=generator, dtype=torch.uint8)
    next(iter(model.train(frames, np.arange(n) % 2)), None)
    model.predict(frames[:2])


def _cached(scene: Scene, folder: Path, progress: Progress, name: str) -> Scene:
    bar: list[Any] = []

    def show(done: int, total: int) -> None:
        if not bar:
            bar.append(progress.add_task(f"make {name} frames ({scene.origin})", total=total))
        progress.update(bar[0], completed=done, refresh=True)

    return data.cached(scene, folder, show)


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
        auto_refresh=False,  # no thread draws while the clock runs
    )
