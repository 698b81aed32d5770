"""The accuracy of a model inside the training frames, for a search of its settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from msgspec import Meta

from baselines.folds import folds
from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.evaluate import train_until
from experiments.protocol.model import check_model, instantiate
from experiments.protocol.settings import Seed, Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from hdc.accuracy import accuracy

ACCURACY = "validation_accuracy"


class Validation(Task, frozen=True):
    """One row: a model that learnt all folds of the training frames but one, asked for that one.

    Folds are whole groups where the split has groups, else whole sessions, else frames at random.
    The test frames of the split have no say. Arguments: configs/experiment/validation.yaml.
    """

    scene: Mapping[str, Any]
    split: Split
    model: Mapping[str, Any]
    stop: StopRule
    seed: Seed
    folds: Annotated[int, Meta(ge=2)]

    def rows(self, context: Context) -> Iterator[Row]:
        scene = context.scene(self.scene, self.seed)
        train, _ = choose(scene, self.split, self.seed)
        session, group = scene.samples.get("session"), self.split.group
        groups = scene.samples[group] if group else None
        parts, made = folds(scene.labels, train, self.folds, groups, session)
        if not parts:
            expected = "training frames that can be parted, every class in each part"
            raise ValueError(f"task.folds: expected {expected}, found none ({made})")
        for number, (learnt, asked) in enumerate(parts):
            model = instantiate(self.model, "model")
            check_model(model)
            frames = data.take(scene, learnt, Clock())
            train_until(model, self.stop, frames, scene.labels[learnt])
            predicted = model.predict(data.take(scene, asked, Clock())[:])
            yield {
                "fold": number,
                "folds": made,
                "n_train": len(learnt),
                "n_validation": len(asked),
                ACCURACY: accuracy(predicted, scene.labels[asked]),
                "origin": scene.origin,
            }
