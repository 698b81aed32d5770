"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and made anew,
and then trained under the clock; it is evaluated whenever it can predict, with the clock stopped.
``-m`` runs every combination of the values given; a finished run is not repeated.
"""

from __future__ import annotations

import functools
import os
import sys
import traceback
import warnings
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from experiments import data, evaluate, record
from experiments.clock import Clock, timed
from experiments.protocol import FrameSource, Model
from experiments.stop import StopRule
from scenes.frames import Scene

console = Console()

# Keys that say how a run is carried out, not what it computes.
_NOT_IDENTITY = ("force", "cache", "task")
_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20

OmegaConf.register_new_resolver(
    "results_dir", lambda: str(record.results_dir()), replace=True, use_cache=False
)


@hydra.main(version_base="1.3", config_path="../configs", config_name="config")
def main(cfg: DictConfig) -> None:
    """Run what the config says."""
    torch.set_num_threads(int(cfg.threads or os.cpu_count() or 1))
    if cfg.task is not None:
        hydra.utils.instantiate(cfg.task, _recursive_=False, _convert_="all")
        return
    run(cfg, dict(HydraConfig.get().runtime.choices))


def run(cfg: DictConfig, choices: dict[str, str | None]) -> dict[str, Any]:
    """Carry out one run, or find that it is finished; returns its record.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
    """
    config = OmegaConf.to_container(cfg, resolve=True)
    assert isinstance(config, dict)
    for key in _NOT_IDENTITY:
        config.pop(key)
    config["threads"] = torch.get_num_threads()
    scene: Scene = _instantiate(cfg.scene, "scene")
    fingerprint = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in ("scene", "model", "stop")}
    identity = record.run_id(names["scene"], names["model"], config, fingerprint)
    folder = record.results_dir() / "runs" / identity
    known = record.read_record(folder)
    if known and known["status"] == "finished" and not cfg.force:
        _summarise(known, folder, repeated=True)
        return known
    entry: dict[str, Any] = {
        "schema": record.SCHEMA,
        "id": identity,
        "status": "running",
        "command": record.command(),
        "choices": names,
        "experiment": choices.get("experiment"),
        "config": config,
        "environment": record.environment(cfg.device, torch.get_num_threads()),
        "scene": {
            "name": names["scene"],
            "origin": scene.origin,
            "classes": list(scene.classes),
            "shape": list(scene.shape),
            "n": len(scene.labels),
            "fingerprint": fingerprint,
        },
    }
    record.write_record(folder, entry)
    curve: list[dict[str, float]] = []
    try:
        entry |= _train_and_test(cfg, scene, names, curve)
        entry["status"] = "finished"
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()
        raise
    finally:
        if curve:
            record.write_curve(folder, curve)
        record.write_record(folder, entry)
    _summarise(entry, folder)
    return entry


def _instantiate(node: DictConfig, key: str) -> Any:
    """Build an object of the config; an error of its own names the key and keeps its message."""
    try:
        return hydra.utils.instantiate(node, _convert_="all")
    except hydra.errors.InstantiationException as error:
        cause = error.__cause__
        if isinstance(cause, ValueError | TypeError | OSError):
            raise type(cause)(f"{key}: {cause}") from error
        raise


def _train_and_test(
    cfg: DictConfig, scene: Scene, names: dict[str, str], curve: list[dict[str, float]]
) -> dict[str, Any]:
    """Everything between the scene and the record; rows are added to the curve as they come."""
    make_model = functools.partial(_instantiate, cfg.model, "model")
    stop: StopRule = _instantiate(cfg.stop, "stop")
    clock = Clock(cfg.device)
    with _progress() as progress:
        if cfg.cache:
            scene = _cached(scene, progress, names["scene"])
        if cfg.data.pixels is not None:
            scene = data.PixelSubset(scene, cfg.data.pixels, cfg.seed.pixels)
        split = OmegaConf.to_container(cfg.split, resolve=True)
        train_indices, test_indices = data.choose(scene, split, cfg.seed.split)
        train, test = (data.take(scene, i, clock) for i in (train_indices, test_indices))
        train_labels, test_labels = scene.labels[train_indices], scene.labels[test_indices]
        _warm_up(make_model(), scene, min(len(train), _WARM_UP_FRAMES))
        model: Model = make_model()
        bar = progress.add_task(f"train {names['model']}", total=None)
        reason = _train(model, train, train_labels, test, test_labels, clock, stop, curve, (
            lambda text: progress.update(bar, description=f"train {names['model']} {text}")))  # fmt: skip
    if not curve:
        raise ValueError(f"model {names['model']}: expected at least one report, found none")
    return _results(model, clock, stop, reason, curve) | _predictions(
        cfg, scene, model, train, test, train_indices, test_indices
    )


def _train(
    model: Model,
    train: FrameSource,
    train_labels: np.ndarray,
    test: FrameSource,
    test_labels: np.ndarray,
    clock: Clock,
    stop: StopRule,
    curve: list[dict[str, float]],
    show: Any,
) -> str:
    """Train under the clock, evaluate with the clock stopped; returns the name of the stop."""
    reports = model.train(train, train_labels)
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return "finished"
        loss = report.get("loss")
        row: dict[str, float] = {"training_s": clock.seconds, **report}
        if loss is None or np.isfinite(loss):
            row["train_accuracy"] = evaluate.accuracy(model.predict(train), train_labels)
            row["test_accuracy"] = evaluate.accuracy(model.predict(test), test_labels)
            show(
                f"{clock.seconds:.2f} s  train {row['train_accuracy']:.1%}  "
                f"test {row['test_accuracy']:.1%}"
            )
        curve.append(row)
        name = stop.check(clock.seconds, loss, row.get("train_accuracy", 0.0))
        if name:
            return name


def _results(
    model: Model,
    clock: Clock,
    stop: StopRule,
    reason: str,
    curve: list[dict[str, float]],
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
    cfg: DictConfig,
    scene: Scene,
    model: Model,
    train: FrameSource,
    test: FrameSource,
    train_indices: np.ndarray,
    test_indices: np.ndarray,
) -> dict[str, Any]:
    """The final model on the test samples: accuracy, interval, confusion, time a frame."""
    train_labels, test_labels = scene.labels[train_indices], scene.labels[test_indices]
    held = test[:]
    predicted = np.asarray(model.predict(held))
    right = int((predicted == test_labels).sum())
    low, high = evaluate.wilson(right, len(test_labels))
    singles = [timed(lambda i=i: model.predict(held[i : i + 1]), cfg.device) for i in range(
        min(_SINGLE_FRAMES, len(held)))]  # fmt: skip
    batch = min(timed(lambda: model.predict(held), cfg.device) for _ in range(3))
    return {
        "n_train": len(train_indices),
        "n_test": len(test_indices),
        "train_accuracy_final": evaluate.accuracy(model.predict(train), train_labels),
        "test_accuracy_final": right / len(test_labels),
        "test_ci_low": low,
        "test_ci_high": high,
        "confusion": evaluate.confusion(predicted, test_labels, len(scene.classes)),
        "test_indices": test_indices,
        "test_labels": test_labels,
        "predicted": predicted,
        "predict_single_s": float(np.median(singles)),
        "predict_batch_s_per_frame": batch / len(held),
        "data_sha256": {
            "train": data.digest(train, train_labels),
            "test": data.digest(held, test_labels),
        },
    }


def _warm_up(model: Model, scene: Scene, n: int) -> None:
    """Train and predict once on noise of the same shape: the first use of anything is slow."""
    generator = torch.Generator().manual_seed(0)
    frames = torch.randint(0, 256, (n, *scene.shape), generator=generator, dtype=torch.uint8)
    next(iter(model.train(frames, np.arange(n) % 2)), None)
    model.predict(frames[:2])


def _cached(scene: Scene, progress: Progress, name: str) -> Scene:
    bar: list[Any] = []

    def show(done: int, total: int) -> None:
        if not bar:
            bar.append(progress.add_task(f"make {name} frames ({scene.origin})", total=total))
        progress.update(bar[0], completed=done)

    return data.cached(scene, record.results_dir() / "cache", show)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )


def _summarise(entry: dict[str, Any], folder: Path, repeated: bool = False) -> None:
    """A few lines on the terminal: accuracy with its interval, confusion, times, where it lies."""
    from rich.table import Table

    scene = entry["scene"]
    console.print(
        f"[bold]{entry['choices']['model']}[/bold] on [bold]{scene['name']}[/bold] "
        f"({scene['origin']}), {entry['n_train']} training and {entry['n_test']} test samples"
    )
    console.print(
        f"  test accuracy {entry['test_accuracy_final']:.1%} "
        f"(95 % interval {entry['test_ci_low']:.1%} to {entry['test_ci_high']:.1%})"
    )
    console.print(
        f"  training {entry['training_s']:.4g} s ({entry['stop']}), prediction "
        f"{entry['predict_single_s'] * 1e3:.3g} ms a single frame, "
        f"{entry['predict_batch_s_per_frame'] * 1e3:.3g} ms a frame in a batch"
    )
    if len(scene["classes"]) <= 12:
        table = Table(title="confusion (rows: true class)", title_justify="left")
        table.add_column("")
        for name in scene["classes"]:
            table.add_column(name, justify="right")
        for name, row in zip(scene["classes"], np.asarray(entry["confusion"]), strict=True):
            table.add_row(name, *(str(n) if n else "·" for n in row))
        console.print(table)
    note = " (finished before; force=true runs it again)" if repeated else ""
    console.print(f"  record {os.path.relpath(folder)}{note}", soft_wrap=True)


def entry_point() -> None:
    """:func:`main`, with an error that is the user's shown as one line."""
    warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
    try:
        main()
    except (ValueError, TypeError, FileNotFoundError) as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        console.print(f"[red]error:[/red] {error}", soft_wrap=True, highlight=False)
        sys.exit(1)


if __name__ == "__main__":
    entry_point()
