"""How much accuracy is left when something goes wrong after training.

Every model is trained on clean frames, once a seed. Then its test frames are disturbed (laser
power, dead pixels, a shifted camera), or its stored bits are flipped at a bit error rate, as the
fault tolerance is tested that hyperdimensional computing claims for itself. A model that stores
floating-point numbers is tested a second time with these in 8 bits each, which tells the tolerance
of the method from that of the number format. One row a model, disturbance, level, seed and draw of
the disturbance: ``results/measured/robustness/rows.csv``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from torch import Tensor

from experiments import data, evaluate, measurement, record
from experiments.clock import Clock
from experiments.disturbances import OF_FRAMES, flipped_bits, flipped_bits_of_int8
from experiments.measurement import Row
from experiments.protocol import Model
from experiments.stop import StopRule
from experiments.trial import instantiate
from scenes.frames import Scene

NAME = "robustness"
_FAILURES = (RuntimeError, ValueError, IndexError)  # of a model that was damaged

console = Console(highlight=False)


def run(
    scene: str,
    models: Sequence[str],
    stop: str,
    seeds: Sequence[int],
    power: Sequence[float],
    dead_pixels: Sequence[float],
    shift: Sequence[int],
    bit_error_rates: Sequence[float],
    draws: int,
    stops: Mapping[str, str] | None = None,
    spared: Mapping[str, Sequence[str]] | None = None,
    overrides: Sequence[str] = (),
    force: bool = False,
) -> None:
    """Measure all of it, unless that was done before.

    Args:
        scene: a file of configs/scene.
        models: files of configs/model.
        stop: the file of configs/stop that ends their training.
        seeds: each one a sensor, a session, a split and initial weights.
        power, dead_pixels, shift: levels of the disturbances of frames.
        bit_error_rates: of the flips in a model's stored bits.
        draws: how often bits are drawn at each rate.
        stops: by model, another such file than `stop`.
        spared: by model, names of its stored tensors in which no bit is flipped.
        overrides: ``key=value`` for the config of every run: ``split.n_train=50``.
        force: measure again.
    """
    levels = {"power": power, "dead_pixels": dead_pixels, "shift": shift}

    def composed(model: str, seed: int) -> DictConfig:
        return _compose(scene, model, (stops or {}).get(model, stop), seed, overrides)

    configs = {model: composed(model, seeds[0]) for model in models}
    first = next(iter(configs.values()))
    if first.data.pixels is not None:
        raise ValueError(
            f"data.pixels: expected null, frames as a whole, found {first.data.pixels}"
        )
    config = {
        "_target_": "experiments.robustness.run",
        "scene_name": scene,
        "scene": _plain(first.scene),
        "split": _plain(first.split),
        "models": {m: {"model": _plain(c.model), "stop": _plain(c.stop)}
                   for m, c in configs.items()},
        "overrides": list(overrides),
        "seeds": list(seeds),
        **{name: list(values) for name, values in levels.items()},
        "bit_error_rates": list(bit_error_rates),
        "draws": draws,
        "spared": {name: list(tensors) for name, tensors in (spared or {}).items()},
    }  # fmt: skip

    def compute() -> Iterator[Row]:
        for seed in seeds:
            source = None
            for model in models:
                console.print(f"[dim]{NAME}: seed {seed}, {model}[/dim]")
                cfg = composed(model, seed)
                source = source or _frames_on_disk(cfg)
                skipped = (spared or {}).get(model, ())
                for row in rows_of(cfg, source, levels, bit_error_rates, draws, skipped):
                    yield {"scene": scene, "origin": source.origin, "model": model, "seed": seed,
                           **row}  # fmt: skip

    measurement.measure(NAME, config, compute, force=force, console=console)


def rows_of(
    cfg: DictConfig,
    scene: Scene,
    levels: Mapping[str, Sequence[float]],
    bit_error_rates: Sequence[float],
    draws: int,
    spared: Sequence[str] = (),
) -> Iterator[Row]:
    """The rows of one model and seed; the first is without any disturbance."""
    seed = int(cfg.seed.run)
    clock = Clock(cfg.device)
    train, test = data.choose(scene, OmegaConf.to_container(cfg.split), cfg.seed.split)
    labels = scene.labels[test]
    model = _trained(cfg, data.take(scene, train, clock), scene.labels[train], clock)
    frames = data.take(scene, test, clock)[:]

    def row(disturbance: str, level: float, draw: int, predicted: np.ndarray) -> Row:
        right = int((predicted == labels).sum())
        low, high = evaluate.wilson(right, len(labels))
        return {"disturbance": disturbance, "level": level, "draw": draw, "n_test": len(labels),
                "right": right, "accuracy": right / len(labels), "ci_low": low, "ci_high": high,
                "chance": 1 / len(scene.classes), "model_bits": bits}  # fmt: skip

    bits = 8 * sum(t.numel() * t.element_size() for t in model.state_tensors().values())
    yield row("none", 0.0, 0, model.predict(frames))
    for place, (name, values) in enumerate(levels.items()):
        for level in values:
            random = np.random.default_rng([seed, place])
            disturbed = torch.from_numpy(OF_FRAMES[name](frames.numpy(), level, random))
            yield row(name, level, 0, model.predict(disturbed))
    damaged = [t for name, t in model.state_tensors().items() if name not in spared]
    for place, rate in enumerate(bit_error_rates):
        for draw in range(draws):
            with flipped_bits(damaged, rate, (seed, place, draw)):
                predicted = _answers(model, frames)
            yield row("bit_flips", rate, draw, predicted)
    if not any(tensor.is_floating_point() for tensor in damaged):
        return
    for place, rate in enumerate([0.0, *bit_error_rates]):
        for draw in range(draws if rate else 1):
            with flipped_bits_of_int8(damaged, rate, (seed, place, draw)):
                predicted = _answers(model, frames)
            yield row("bit_flips_int8", rate, draw, predicted)


def _frames_on_disk(cfg: DictConfig) -> Scene:
    scene: Scene = instantiate(cfg.scene, "scene")
    return data.cached(scene, record.results_dir() / "cache", lambda *_: None)


def _trained(cfg: DictConfig, frames: Any, labels: np.ndarray, clock: Clock) -> Model:
    """A model trained until its stopping rule ends it; the test samples have no say."""
    model: Model = instantiate(cfg.model, "model")
    stop: StopRule = instantiate(cfg.stop, "stop")
    reports = iter(model.train(frames, labels))
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return model
        loss, accuracy = report.get("loss"), 0.0
        if loss is not None:  # what learns in one pass is left to finish
            accuracy = evaluate.accuracy(model.predict(frames), labels)
        if stop.check(clock.seconds, loss, accuracy):
            return model


def _answers(model: Model, frames: Tensor) -> np.ndarray:
    """Predicted labels; −1 for all where the damaged model cannot be asked."""
    try:
        return model.predict(frames)
    except _FAILURES:
        return np.full(len(frames), -1)


def _compose(
    scene: str, model: str, stop: str, seed: int, overrides: Sequence[str] = ()
) -> DictConfig:
    """The config of one run, as the runner composes it."""
    words = [f"scene={scene}", f"model={model}", f"stop={stop}", f"seed.run={seed}", *overrides]
    if GlobalHydra.instance().is_initialized():  # called as a task, from within Hydra
        return compose("config", overrides=words)
    with initialize_config_dir(str(record.ROOT / "configs"), version_base="1.3"):
        return compose("config", overrides=words)


def _plain(node: Any) -> Any:
    """A part of a config with its references to seeds left as they are."""
    return OmegaConf.to_container(node, resolve=False)
