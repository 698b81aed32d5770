"""Accuracy that is left when something goes wrong after training.

Every model is trained on clean frames, once per seed. Then its test frames are disturbed, or bits
are flipped at a bit error rate: of what it stores, or of what it is asked, which is a hypervector
of HDC and the pixels of a frame of any other. A model that stores floating-point numbers is tested
a second time with 8 bits a number: is it the method that tolerates faults, or the number format?
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

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
            asked = data.take(sensor, test, Clock())[:]
            labels = sensor.labels[test]
            for name, model in models_of(at_seed(self.models, seed)).items():
                rule = self.stops.get(name, self.stop)
                train_until(model, rule, frames, sensor.labels[train])
                state = library.state_tensors(model) or {}
                spared = (self.spared or {}).get(name, ())
                damaged = [state[part] for part in state if part not in spared]
                made = self._answers(model, asked, damaged, seed)
                for disturbance, level, predicted in made:
                    yield {
                        "origin": sensor.origin,
                        "model": name,
                        "seed": seed,
                        "disturbance": disturbance,
                        "level": float(level),
                        "right": int((predicted == labels).sum()),
                        "n_test": len(labels),
                        "model_bytes": sum(each.nbytes for each in state.values()),
                        "n_classes": len(sensor.classes),
                    }
                context.note(f"seed {seed}, {name}")

    def _answers(
        self, model: Model, frames: Tensor, damaged: Sequence[Tensor], seed: int
    ) -> Iterator[tuple[str, float, np.ndarray]]:
        """Disturbance, level, and what the model predicts, which is left as it was; undisturbed
        first."""
        has_floats = any(tensor.is_floating_point() for tensor in damaged)
        int8 = faults.flipped_bits_of_int8
        yield "none", 0, model.predict(frames)
        for number, (name, levels) in enumerate(self.disturbances.items()):
            for level in levels:
                random = np.random.default_rng([seed, number])
                found = faults.OF_FRAMES[name](frames.numpy(), level, random)
                disturbed = torch.from_numpy(found)
                yield name, level, model.predict(disturbed)
                if name == "dither" and has_floats:  # frames and weights rounded, both
                    rounded = _with_flips(model, disturbed, damaged, int8, 0.0, seed)
                    yield "dither_of_int8", level, rounded
        for rate in self.query_error_rates:
            yield "query_flips", rate, _asked_with_flips(model, frames, rate, seed)
        kinds = [("bit_flips", faults.flipped_bits, self.bit_error_rates)]
        if has_floats:  # 0: rounding alone
            kinds += [("bit_flips_int8", int8, (0.0, *self.bit_error_rates))]
        for name, flipped, rates in kinds:
            for rate in rates:
                found = _with_flips(model, frames, damaged, flipped, rate, seed)
                yield name, rate, found


def _asked_with_flips(
    model: Model, frames: Tensor, rate: float, seed: int
) -> np.ndarray:
    """Labels of frames by bits of which some are flipped."""
    key = (seed, round(1e9 * rate), 1)
    random = np.random.default_rng(key)
    if isinstance(model, HDCClassifier):
        words: Any = faults.flipped_queries(model.encode(frames), rate, random)
        return model.predict(words)
    pixels = faults.flipped_pixels(frames.numpy(), rate, random)
    return model.predict(torch.from_numpy(pixels))


def _with_flips(
    model: Model,
    frames: Tensor,
    damaged: Sequence[Tensor],
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
