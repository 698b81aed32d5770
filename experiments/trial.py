"""One trial: a model trained on a scene's frames under the clock and tested with it stopped."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from torch import Tensor

from experiments import data, evaluate
from experiments.clock import Clock, timed
from experiments.protocol import Model
from experiments.stop import StopRule
from scenes.frames import Scene

_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20


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
    names: dict[str, str],
    curve: list[dict[str, float]],
    cache: Path | None,
    console: Console,
) -> dict[str, Any]:
    """Everything between the scene and the record; rows are added to the curve as they come.

    Args:
        cfg: the composed config.
        scene: where the frames come from.
        names: which file of each group the config was composed from.
        curve: gets one row a report of the model, whatever happens later.
        cache: folder in which frames are kept, or None.
        console: shows the progress.

    Returns:
        dict: what the record holds of the model's times, accuracies and predictions.
    """
    # Whatever is wrong with these is found before any frame is made.
    stop: StopRule = instantiate(cfg.stop, "stop")
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
    results = _results(model, clock, stop, reason, curve)
    return results | _predictions(cfg.device, model, train, test, len(scene.classes))


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
    with clock.running():
        reports = iter(model.train(train.frames, train.labels))
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return "finished"
        loss = report.get("loss")
        row: dict[str, float] = {"training_s": clock.seconds, **report}
        if loss is None or np.isfinite(loss):
            row["train_accuracy"] = train.accuracy(model)
            row["test_accuracy"] = test.accuracy(model)
            show(
                f"{clock.seconds:.2f} s  train {row['train_accuracy']:.1%}  "
                f"test {row['test_accuracy']:.1%}"
            )
        curve.append(row)
        name = stop.check(clock.seconds, loss, row.get("train_accuracy", 0.0))
        if name:
            return name


def _results(
    model: Model, clock: Clock, stop: StopRule, reason: str, curve: list[dict[str, float]]
) -> dict[str, Any]:
    """What the curve says."""
    valid = [row for row in curve if "test_accuracy" in row]

    def first_above(key: str) -> float | None:
        return next((row["training_s"] for row in valid if row[key] > stop.target), None)

    def best(key: str) -> float | None:
        return max((row[key] for row in valid), default=None)

    return {
        "stop": reason,
        "training_s": clock.seconds,
        "time_to_target_train_s": first_above("train_accuracy"),
        "time_to_target_test_s": first_above("test_accuracy"),
        "train_accuracy_max": best("train_accuracy"),
        "test_accuracy_max": best("test_accuracy"),
        "reports": len(curve),
        "model_bytes": sum(t.numel() * t.element_size() for t in model.state_tensors().values()),
    }


def _predictions(
    device: str, model: Model, train: _Part, test: _Part, n_classes: int
) -> dict[str, Any]:
    """The final model on the test samples: accuracy, interval, confusion, time a frame."""
    frames = test.frames[:]
    predicted = np.asarray(model.predict(frames))
    right = int((predicted == test.labels).sum())
    low, high = evaluate.wilson(right, len(frames))
    singles = [
        timed(functools.partial(model.predict, frames[i : i + 1]), device)
        for i in range(min(_SINGLE_FRAMES, len(frames)))
    ]
    batch = min(timed(functools.partial(model.predict, frames), device) for _ in range(3))
    return {
        "n_train": len(train.indices),
        "n_test": len(test.indices),
        "train_accuracy_final": train.accuracy(model),
        "test_accuracy_final": right / len(frames),
        "test_ci_low": low,
        "test_ci_high": high,
        "confusion": evaluate.confusion(predicted, test.labels, n_classes),
        "test_indices": test.indices,
        "test_labels": test.labels,
        "predicted": predicted,
        "predict_single_s": float(np.median(singles)),
        "predict_batch_s_per_frame": batch / len(frames),
        "data_sha256": {
            "train": data.digest(train.frames, train.labels),
            "test": data.digest(frames, test.labels),
        },
    }


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
