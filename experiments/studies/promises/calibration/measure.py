"""Whether the library's probabilities of classes are as often right as they say.

A model is trained on n frames of each class and gives held-out frames probabilities, calibrated by
its training frames alone (:mod:`hdc.probability`). A random split keeps what that supposes: frames
that come as the training frames did. A split by time, session or group does not.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import bank_of
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import draw_split, nested
from experiments.records.rows import pack_labels
from hdc import HDCClassifier
from hdc.bank import Bank

STEPS = 1000
"""A probability is stored as a whole number of this."""


@experiment(revision=2, uses=("hdc.HDCClassifier",))
def calibration(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Split],
    models: Mapping[str, Any],
    n_per_class: Sequence[int] = (20,),
    draws: int = 3,
    seeds: Sequence[int] = (0,),
    most_test: int = 400,
) -> Iterator[Row]:
    """One row: one model in one draw of one split after ``n`` frames of each class; what it
    ``predicted`` of ``n_test`` frames, and the probability ``sure`` of each answer in ‰.

    ``predicted``, ``sure`` and the true ``labels`` are texts of
    :func:`experiments.records.rows.pack_labels`.
    Arguments: configs/experiment/calibration.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """
    asked = models_of(at_seed(models, 0))
    for seed, recording in run.scenes(scene, seeds):
        bank = bank_of(recording)
        for split, wanted in splits.items():
            for k in range(draws):
                pool, test = draw_split(recording, wanted, (seed, k), most_test)
                order, sizes = nested(pool, bank.labels, n_per_class, (seed, k))
                common = {
                    "origin": recording.origin,
                    "seed": seed,
                    "split": split,
                    "draw": k,
                    "n_test": len(test),
                    "labels": pack_labels(bank.labels[test]),
                }
                for n in sizes:
                    train = np.concatenate([of_class[:n] for of_class in order])
                    for name, model in asked.items():
                        found = _answers(model, bank, train, test)
                        yield {**common, "n": n, "model": name, **found}
            run.note(f"seed {seed}, split {split}")


def _answers(
    model: HDCClassifier, bank: Bank, train: np.ndarray, test: np.ndarray
) -> Row:
    """What a model says of test frames, and how sure it is."""
    trained = copy.deepcopy(model).fit(bank.at(train), bank.labels[train])
    shares = trained.predict_proba(bank.at(test))
    predicted = trained.classes_[shares.argmax(axis=1)]
    sure = np.rint(STEPS * shares.max(axis=1)).astype(int)
    return {"predicted": pack_labels(predicted), "sure": pack_labels(sure)}
