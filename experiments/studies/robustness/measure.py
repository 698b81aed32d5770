"""How much accuracy is left when something goes wrong after training.

Every model is trained on clean frames, once a seed. Then its test frames are disturbed (laser
power, dead pixels, a shifted camera), or its stored bits are flipped at a bit error rate, as the
fault tolerance is tested that hyperdimensional computing claims for itself. A model that stores
floating-point numbers is tested a second time with these in 8 bits each, which tells the tolerance
of the method from that of the number format.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from rich.console import Console
from torch import Tensor

from experiments.protocol import data, evaluate
from experiments.protocol.clock import Clock
from experiments.protocol.model import Model
from experiments.protocol.scenes import at_seed, scenes
from experiments.protocol.stop import StopRule
from experiments.protocol.trial import instantiate, stop_rule
from experiments.records.measurement import Row, measure
from experiments.studies.robustness.disturbances import (
    OF_FRAMES,
    flipped_bits,
    flipped_bits_of_int8,
)
from scenes.frames import Scene

_FAILURES = (RuntimeError, ValueError, IndexError)  # of a model that was damaged


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    models: Mapping[str, Mapping[str, Any]],
    stop: Mapping[str, Any],
    stops: Mapping[str, Mapping[str, Any]],
    seeds: Sequence[int],
    power: Sequence[float],
    dead_pixels: Sequence[float],
    shift: Sequence[int],
    bit_error_rates: Sequence[float],
    draws: int,
    spared: Mapping[str, Sequence[str]],
    pixels: int | None = None,
    device: str = "cpu",
    cache: bool = True,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/robustness/``.

    Args:
        scene, split: configurations.
        models: by name, what a file of ``configs/model`` holds; only its part ``model`` counts.
        stop: configuration of the rule that ends a training.
        stops: by model, another such rule.
        seeds: each one a sensor, a session, a split and initial weights.
        power, dead_pixels, shift: levels of the disturbances of frames.
        bit_error_rates: rates of the flips in a model's stored bits.
        draws: how often bits are drawn at each rate.
        spared: by model, names of its stored tensors in which no bit is flipped.
        pixels: none, since a camera that moved is seen in whole frames only.
        device: ``cpu``, in whose memory the bits are flipped.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``model``, ``seed``;
        ``disturbance``, its ``level`` and the ``draw`` of its bits; ``right`` of ``n_test``
        samples, ``accuracy`` with Wilson's interval, that of ``chance``; ``model_bits``, stored.

    Raises:
        ValueError: naming the key, for a choice of pixels, another device, or a model that does not
            tell what it stores.
    """
    if pixels is not None:
        raise ValueError(f"data.pixels: expected null, frames as a whole, found {pixels}")
    if device != "cpu":
        raise ValueError(f"device: expected cpu, where bits can be flipped, found {device}")
    console = Console(highlight=False)
    levels = {"power": power, "dead_pixels": dead_pixels, "shift": shift}
    chosen = {name: {"model": part["model"]} for name, part in models.items()}
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "models": chosen,
        "stop": stop,
        "stops": {name: rule for name, rule in stops.items() if name in models},
        "seeds": seeds,
        **levels,
        "bit_error_rates": bit_error_rates,
        "draws": draws,
        "spared": spared,
    }

    def compute() -> Iterator[Row]:
        for seed, made in scenes(scene, seeds, cache, console):
            train, test = data.choose(made, split, seed)
            for name, part in chosen.items():
                console.print(f"[dim]robustness: seed {seed}, {name}[/dim]")
                model = instantiate(OmegaConf.create(at_seed(part["model"], seed)), "model")
                rule = stop_rule(OmegaConf.create(dict(stops.get(name, stop))))
                train_until(model, rule, made, train)
                if model.state_tensors() is None:
                    raise ValueError(
                        f"task.models.{name}: expected a model that tells what it stores, "
                        f"found {type(model).__name__} with state_tensors() None"
                    )
                rows = rows_of(
                    model, made, test, levels, bit_error_rates, draws, spared.get(name, ()), seed
                )
                for row in rows:
                    yield {"origin": made.origin, "model": name, "seed": seed, **row}

    return measure("robustness", config, compute, device=device, force=force, console=console)


def train_until(model: Model, stop: StopRule, scene: Scene, train: np.ndarray) -> None:
    """Train on these samples until the rule ends it; test samples have no say."""
    clock, labels = Clock(), scene.labels[train]
    frames = data.take(scene, train, clock)
    reports = iter(model.train(frames, labels))
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return
        loss, accuracy = report.get("loss"), 0.0
        if loss is not None and stop.reached_after_s is not None:  # else it has no say
            accuracy = evaluate.accuracy(model.predict(frames), labels)
        if stop.check(clock.seconds, report.get("steps", 0), loss, accuracy):
            return


def rows_of(
    model: Model,
    scene: Scene,
    test: np.ndarray,
    levels: Mapping[str, Sequence[float]],
    bit_error_rates: Sequence[float],
    draws: int,
    spared: Sequence[str] = (),
    seed: int = 0,
) -> Iterator[Row]:
    """The rows of one trained model; the first is without any disturbance.

    Args:
        model: left as it was.
        scene, test: the frames, and indices of the test samples among them.
        levels: by disturbance of frames.
        bit_error_rates, draws, spared: as in :func:`run`.
        seed: seed of what is drawn.
    """
    labels = scene.labels[test]
    frames = data.take(scene, test, Clock())[:]
    state = model.state_tensors() or {}
    bits = 8 * sum(tensor.nbytes for tensor in state.values())

    def row(disturbance: str, level: float, draw: int, predicted: np.ndarray) -> Row:
        right = int((predicted == labels).sum())
        low, high = evaluate.wilson(right, len(labels))
        return {
            "disturbance": disturbance,
            "level": level,
            "draw": draw,
            "n_test": len(labels),
            "right": right,
            "accuracy": right / len(labels),
            "ci_low": low,
            "ci_high": high,
            "chance": 1 / len(scene.classes),
            "model_bits": bits,
        }

    yield row("none", 0.0, 0, model.predict(frames))
    for place, (name, values) in enumerate(levels.items()):
        for level in values:
            random = np.random.default_rng([seed, place])
            disturbed = torch.from_numpy(OF_FRAMES[name](frames.numpy(), level, random))
            yield row(name, level, 0, model.predict(disturbed))
    damaged = [tensor for name, tensor in state.items() if name not in spared]
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


def _answers(model: Model, frames: Tensor) -> np.ndarray:
    """Predicted labels; −1 for all where the damaged model cannot be asked."""
    try:
        return model.predict(frames)
    except _FAILURES:
        return np.full(len(frames), -1)
