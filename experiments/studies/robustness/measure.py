"""Accuracy that is left when something goes wrong after training.

Every model is trained on clean frames, once per seed. Then its test frames are disturbed, or bits
of what it stores are flipped at a bit error rate. A model that stores floating-point numbers is
tested a second time with 8 bits a number: is it the method that tolerates faults, or the number
format?
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

_STREAM = 3  # of the random numbers of a seed that disturb frames


class Robustness(Task, frozen=True):
    """One row: a trained model under one disturbance, ``right`` of ``n_test`` samples.

    ``level`` is that of the ``disturbance``, a fraction or pixels. Models are on the CPU.
    Arguments: configs/experiment/robustness.yaml.
    """

    revision: ClassVar = 4
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    split: Split
    models: Mapping[str, Mapping[str, Any]]
    stop: StopRule
    seeds: Sequence[int]
    disturbances: Mapping[str, Sequence[float | int]]
    bit_error_rates: Sequence[float | int]
    spared: Mapping[str, Sequence[str]] | None = None

    def rows(self, context: Context) -> Iterator[Row]:
        for seed, sensor in context.scenes(self.scene, self.seeds):
            train, test = choose(sensor, self.split, seed)
            frames = data.take(sensor, train, Clock())
            asked = data.take(sensor, test, Clock())[:]
            labels = sensor.labels[test]
            for name, model in models_of(at_seed(self.models, seed)).items():
                train_until(model, self.stop, frames, sensor.labels[train])
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
        yield "none", 0, model.predict(frames)
        for name, levels in self.disturbances.items():
            for level in levels:
                random = np.random.default_rng([seed, _STREAM])
                disturbed = faults.OF_FRAMES[name](frames.numpy(), level, random)
                yield name, level, model.predict(torch.from_numpy(disturbed))
        rates = self.bit_error_rates
        kinds = [("bit_flips", faults.flipped_bits, rates)]
        if any(tensor.is_floating_point() for tensor in damaged):  # 0: rounding alone
            kinds += [("bit_flips_int8", faults.flipped_bits_of_int8, (0.0, *rates))]
        for name, flipped, of_kind in kinds:
            for rate in of_kind:
                found = _with_flips(model, frames, damaged, flipped, rate, seed)
                yield name, rate, found


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
