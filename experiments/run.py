"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and made anew,
and then trained under the clock; it is evaluated whenever it can predict, with the clock stopped.
``-m`` runs every combination of the values given; a finished run is not repeated.
"""

from __future__ import annotations

import functools
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import hydra
import numpy as np
import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from torch import Tensor

from experiments import data, evaluate, record
from experiments.clock import Clock, timed
from experiments.protocol import Model
from experiments.stop import StopRule
from experiments.summary import summarise
from scenes.frames import Scene

console = Console()
stderr = Console(stderr=True, highlight=False)

# Keys that say how a run is carried out, not what it computes.
_NOT_IDENTITY = ("force", "cache", "task")
_WARM_UP_FRAMES = 40
_SINGLE_FRAMES = 20
# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, hydra.errors.HydraException, OmegaConfBaseException)

_process: int | None = None  # set where the command line was given
_failures: list[Exception] = []

OmegaConf.register_new_resolver(
    "results_dir", lambda: str(record.results_dir()), replace=True, use_cache=False
)


@hydra.main(version_base="1.3", config_path="../configs", config_name="config")
def main(cfg: DictConfig) -> None:
    """Run what the config says; in a multirun, go on with the others after one that failed."""
    try:
        torch.set_num_threads(_threads(cfg.threads))
        if cfg.task is not None:
            hydra.utils.instantiate(cfg.task, _recursive_=False, _convert_="all")
        else:
            run(cfg, dict(HydraConfig.get().runtime.choices))
    except Exception as error:
        # In a worker of a launcher, or when asked for, Hydra hands the error on.
        if os.getpid() != _process or os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        _failures.append(error)
        _complain(error)


def run(cfg: DictConfig, choices: dict[str, str | None]) -> dict[str, Any]:
    """Carry out one run, or find that it is finished; returns its record.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    config: Any = OmegaConf.to_container(cfg, resolve=True)
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
        summarise(console, known, folder, repeated=True)
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
            "skipped": [str(frame) for frame in getattr(scene, "skipped", ())],
        },
    }
    record.write_record(folder, entry)
    (folder / "curve.csv").unlink(missing_ok=True)  # of an earlier attempt
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
    summarise(console, entry, folder)
    return entry


def _instantiate(node: DictConfig, key: str) -> Any:
    """Build an object of the config; an error of its own names the key and keeps its message."""
    try:
        return hydra.utils.instantiate(node, _convert_="all")
    except hydra.errors.InstantiationException as error:
        cause = error.__cause__
        if not isinstance(cause, ValueError | TypeError | OSError):
            raise
        text = str(cause)
        raise ValueError(text if text.startswith(f"{key}.") else f"{key}: {text}") from error


def _threads(wanted: Any) -> int:
    if wanted is None:
        return (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
    if not isinstance(wanted, int) or isinstance(wanted, bool) or wanted < 1:
        raise ValueError(f"threads: expected an integer from 1, or null, found {wanted!r}")
    return wanted


@dataclass
class _Part:
    """The training or the test samples."""

    indices: np.ndarray
    labels: np.ndarray
    frames: Tensor | data.LazyFrames

    def accuracy(self, model: Model) -> float:
        return evaluate.accuracy(model.predict(self.frames), self.labels)


def _train_and_test(
    cfg: DictConfig, scene: Scene, names: dict[str, str], curve: list[dict[str, float]]
) -> dict[str, Any]:
    """Everything between the scene and the record; rows are added to the curve as they come."""
    # Whatever is wrong with these is found before any frame is made.
    stop: StopRule = _instantiate(cfg.stop, "stop")
    unused: Model = _instantiate(cfg.model, "model")
    split = OmegaConf.to_container(cfg.split, resolve=True)
    chosen = data.choose(scene, split, cfg.seed.split)
    clock = Clock(cfg.device)
    with _progress() as progress:
        if cfg.cache:
            scene = _cached(scene, progress, names["scene"])
        if cfg.data.pixels is not None:
            scene = data.PixelSubset(scene, cfg.data.pixels, cfg.seed.pixels)
        train, test = (
            _Part(indices, scene.labels[indices], data.take(scene, indices, clock))
            for indices in chosen
        )
        _warm_up(unused, scene, min(len(train.labels), _WARM_UP_FRAMES))
        model: Model = _instantiate(cfg.model, "model")
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


def _cached(scene: Scene, progress: Progress, name: str) -> Scene:
    bar: list[Any] = []

    def show(done: int, total: int) -> None:
        if not bar:
            bar.append(progress.add_task(f"make {name} frames ({scene.origin})", total=total))
        progress.update(bar[0], completed=done, refresh=True)

    return data.cached(scene, record.results_dir() / "cache", show)


def _progress() -> Progress:
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


def _complain(error: BaseException) -> None:
    if isinstance(error, _USER_ERRORS):
        stderr.print("[red]error:[/red]", escape(str(error).strip()), soft_wrap=True)
    else:
        traceback.print_exception(error)


def entry_point() -> None:
    """:func:`main`, with an error that is the user's shown as one line; exits with 1 after any."""
    global _process
    _process = os.getpid()
    warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
    # A scheduler's or a user's end of a run is written into its record.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        main()
    except KeyboardInterrupt:
        stderr.print("interrupted; the same command goes on")
        sys.exit(128 + signal.SIGINT)
    sys.exit(1 if _failures else 0)


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
