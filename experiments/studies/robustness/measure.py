"""Accuracy that is left when something goes wrong after training.

Every model is trained on clean frames, once per seed. Then its test frames are disturbed, or bits
are flipped at a bit error rate: of what it stores, or of what it is asked, which is a hypervector
of HDC and the pixels of a frame of any other. A model that stores floating-point numbers is tested
a second time with 8 bits a number: is it the method that tolerates faults, or the number format?
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch

from baselines import library
from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import train_until
from experiments.protocol.model import Model, models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.studies.robustness import disturbances as faults
from hdc import HDCClassifier
from scenes.frames import Scene


class Robustness(Task, frozen=True):
    """One row: a trained model under one disturbance, ``right`` of ``n_test`` samples.

    ``level`` is that of the ``disturbance``, a fraction or pixels. Models are on the CPU.
    Arguments: configs/experiment/robustness.yaml.
    """

    revision: ClassVar = 3
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    split: Split
    models: Mapping[str, Mapping[str, Any]]
    stop: StopRule
    stops: Mapping[str, StopRule]
    seeds: Sequence[int]
    disturbances: Mapping[str, Sequence[float | int]]
    bit_error_rates: Sequence[float | int]
    query_error_rates: Sequence[float | int] = ()
    spared: Mapping[str, Sequence[str]] | None = None

    def rows(self, context: Context) -> Iterator[Row]:
        for seed, sensor in context.scenes(self.scene, self.seeds):
            train, test = choose(sensor, self.split, seed)
            frames = data.take(sensor, train, Clock())
            for name, model in models_of(at_seed(self.models, seed)).items():
                rule = self.stops.get(name, self.stop)
                train_until(model, rule, frames, sensor.labels[train])
                keep = (self.spared or {}).get(name, ())
                rates = Rates(self.bit_error_rates, self.query_error_rates)
                made = rows_of(
                    model, sensor, test, self.disturbances, rates, keep, seed
                )
                for row in made:
                    yield {
                        "origin": sensor.origin,
                        "model": name,
                        "seed": seed,
                        **row,
                    }
                context.note(f"seed {seed}, {name}")


class Rates(NamedTuple):
    """Bit error rates of what a model stores, and of what it is asked."""

    stored: Sequence[float]
    asked: Sequence[float] = ()


def rows_of(
    model: Model,
    scene: Scene,
    test: np.ndarray,
    disturbances: Mapping[str, Sequence[float]],
    rates: Rates,
    spared: Sequence[str] = (),
    seed: int = 0,
) -> Iterator[Row]:
    """The rows of one trained model, which is left as it was; the first is undisturbed."""
    labels = scene.labels[test]
    frames = data.take(scene, test, Clock())[:]
    state = library.state_tensors(model) or {}
    same = {
        "n_test": len(labels),
        "n_classes": len(scene.classes),
        "model_bytes": sum(tensor.nbytes for tensor in state.values()),
    }

    def row(
        disturbance: str,
        level: float,
        predicted: np.ndarray,
    ) -> Row:
        right = int((predicted == labels).sum())
        tested = {
            "disturbance": disturbance,
            "level": float(level),
            "right": right,
        }
        return {**tested, **same}

    damaged = [tensor for name, tensor in state.items() if name not in spared]
    floats = any(tensor.is_floating_point() for tensor in damaged)
    int8 = faults.flipped_bits_of_int8
    yield row("none", 0, model.predict(frames))
    for number, (name, levels) in enumerate(disturbances.items()):
        for level in levels:
            random = np.random.default_rng([seed, number])
            disturbed = torch.from_numpy(
                faults.OF_FRAMES[name](frames.numpy(), level, random)
            )
            yield row(name, level, model.predict(disturbed))
            if name == "dither" and floats:  # frames and weights rounded, both
                predicted = _with_flips(model, disturbed, damaged, int8, 0.0, seed)
                yield row("dither_of_int8", level, predicted)
    for rate in rates.asked:
        yield row("query_flips", rate, _asked_with_flips(model, frames, rate, seed))
    for rate in rates.stored:
        predicted = _with_flips(model, frames, damaged, faults.flipped_bits, rate, seed)
        yield row("bit_flips", rate, predicted)
    if not floats:
        return
    for rate in (0.0, *rates.stored):  # 0: rounding alone
        predicted = _with_flips(model, frames, damaged, int8, rate, seed)
        yield row("bit_flips_int8", rate, predicted)


def _asked_with_flips(
    model: Model, frames: torch.Tensor, rate: float, seed: int
) -> np.ndarray:
    """Labels of frames by bits of which some are flipped."""
    key = (seed, round(1e9 * rate), 1)
    random = np.random.default_rng(key)
    chosen: Any = model
    classifier = getattr(model, "model_", model)  # of a model that chooses its form
    if isinstance(classifier, HDCClassifier):
        words = classifier.encode(frames)
        asked = faults.flipped_queries(words, rate, random)
        labels = classifier.predict(asked)
        return labels if classifier is model else chosen.classes_[labels]
    pixels = faults.flipped_pixels(frames.numpy(), rate, random)
    return model.predict(torch.from_numpy(pixels))


def _with_flips(
    model: Model,
    frames: torch.Tensor,
    damaged: Sequence[torch.Tensor],
    flipped: Any,
    rate: float,
    seed: int,
) -> np.ndarray:
    """Labels by the model with bits flipped; −1 where it is too damaged to be asked."""
    # The same rate flips the same bits whatever other rates there are.
    with flipped(damaged, rate, (seed, round(1e9 * rate), 0)):
        try:
            return model.predict(frames)
        except (RuntimeError, ValueError, IndexError):
            return np.full(len(frames), -1)
