"""Numbers instead of labels, and how often the library's guarantees hold.

Sets of labels, intervals and probabilities are promised for frames recorded under the training
conditions: a random split of one session keeps to them, a split by time, session or position does
not.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from experiments.protocol.data import at_seed, scene_at
from experiments.protocol.evaluate import bank_of
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.protocol.task import Context, Row, Task
from experiments.studies.promises.values.numbers import answers
from hdc import HDCClassifier

BINS = 10
"""Bins of equal width of the probability of an answer."""


class Drawn(Task, frozen=True):
    """A task with several draws of training and test frames of a recording."""

    scene: Mapping[str, Any]
    seeds: Sequence[int]
    draws: int
    most_test: int

    def parts(
        self, context: Context, splits: Mapping[str, Split]
    ) -> Iterator[tuple[Any, Row, np.ndarray, np.ndarray]]:
        """Every draw of every split: recording, start of a row, indices to learn and to test."""
        for seed, recording in context.scenes(self.scene, self.seeds):
            for split, draw in itertools.product(splits, range(self.draws)):
                pool, test = resample_split(
                    recording, splits[split], (seed, draw), self.most_test
                )
                row: Row = {"origin": recording.origin, "seed": seed}
                yield recording, row | {"split": split, "draw": draw}, pool, test
            context.note(f"seed {seed}")


def of_classes(
    recording: Any, row: Row, pool: np.ndarray, n: int
) -> tuple[np.ndarray, int]:
    """Up to n samples of each class of a pool, as many of one as of another, and this number."""
    order, _ = nested(pool, recording.labels, [], (row["seed"], row["draw"]))
    n = min(n, *map(len, order))
    return np.concatenate([of_class[:n] for of_class in order]), n


class Values(Drawn, frozen=True):
    """One row: mean absolute ``error`` of one model's answers to ``n_test`` frames, in ``unit`` of
    the first value of the scene; of the library's regressor also the share of the values ``inside``
    its intervals for ``alpha`` and their mean ``width``. Frames of values below ``at_least`` are
    left out: above its surface, a fibre's actuator presses nothing.

    Arguments: configs/experiment/values.yaml.
    """

    revision: ClassVar = 2
    uses: ClassVar = ("hdc.HDCClassifier",)

    splits: Mapping[str, Split]
    n_train: Sequence[int]
    bins: int
    alpha: float | int
    at_least: float | int | None

    def rows(self, context: Context) -> Iterator[Row]:
        for recording, row, pool, test in self.parts(context, self.splits):
            known: Any = recording  # a cached scene has frames and labels alone
            if not hasattr(recording, "values"):
                known = scene_at(self.scene, row["seed"], False, context.console)
            numbers = known.values[:, 0]
            if self.at_least is not None:
                pool = pool[numbers[pool] >= self.at_least]
                test = test[numbers[test] >= self.at_least]
            random = np.random.default_rng((row["seed"], row["draw"], 1))
            order = random.permutation(pool)
            sizes = [n for n in self.n_train if n <= len(order)]
            train = order[: max(sizes)]
            bank = bank_of(recording, np.concatenate([train, test]))
            queries = np.arange(len(train), len(bank))
            row |= {"value": known.value_names[0], "unit": known.units[0]}
            row["n_test"] = len(test)
            for n in sizes:
                given = bank, numbers[train[:n]], queries, numbers[test]
                for found in answers(*given, self.bins, self.alpha):
                    yield {**row, "n": n, **found}


class Coverage(Drawn, frozen=True):
    """One row: a model in one draw of one split after ``n`` frames of every class.

    The share ``covered`` of ``n_test`` held-out frames by the model's prediction set for ``alpha``,
    the mean ``size`` of the set, and the share ``refused`` of empty sets. Lists over :data:`BINS`
    bins of the probability of an answer: how many ``answers``, how many of them ``right``, the sum
    ``sure`` of their probabilities p, and ``spread`` of p(1 − p); none after one frame, which fits
    no probability.
    Arguments: configs/experiment/coverage.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """

    revision: ClassVar = 5

    splits: Mapping[str, Split]
    models: Mapping[str, Any]
    n_per_class: Sequence[int]
    alpha: float | int

    def rows(self, context: Context) -> Iterator[Row]:
        asked = models_of(at_seed(self.models, 0))
        for recording, row, pool, test in self.parts(context, self.splits):
            most, n_most = of_classes(recording, row, pool, max(self.n_per_class))
            bank = bank_of(recording, np.concatenate([most, test]))
            queries = bank.at(np.arange(len(most), len(bank)))
            labels = recording.labels[test]
            row |= {"n_test": len(test), "alpha": self.alpha}
            for n in sorted({min(n, n_most) for n in self.n_per_class}):
                train = np.flatnonzero(np.arange(len(most)) % n_most < n)
                for name, model in asked.items():
                    model.fit(bank.at(train), bank.labels[train])
                    found = sets(model, queries, labels, self.alpha)
                    if n > 1:
                        found |= probabilities(model, queries, labels)
                    yield {**row, "n": n, "model": name, **found}


def sets(model: HDCClassifier, queries: Any, labels: np.ndarray, alpha: float) -> Row:
    """How often prediction sets of queries [Q] hold the right one of the labels [Q]."""
    with warnings.catch_warnings():
        # That few frames give full sets is what is measured here.
        warnings.filterwarnings("ignore", message=".*no frame is refused")
        found = model.predict_set(queries, alpha)
    sizes = np.array([len(one) for one in found])
    held = [label in one for one, label in zip(found, labels, strict=True)]
    return {
        "covered": float(np.mean(held)),
        "size": float(sizes.mean()),
        "refused": float((sizes == 0).mean()),
    }


def probabilities(model: HDCClassifier, queries: Any, labels: np.ndarray) -> Row:
    """Answers of a model to queries [Q], how sure it is, and how often it is right, by bins."""
    shares = model.predict_proba(queries)
    right = model.classes_[shares.argmax(axis=1)] == labels
    sure = shares.max(axis=1)
    place = np.minimum((BINS * sure).astype(int), BINS - 1)

    def summed(numbers: Any) -> list[float]:
        return np.bincount(place, numbers, BINS).tolist()

    return {
        "answers": summed(np.ones(len(sure))),
        "right": summed(right),
        "sure": summed(sure),
        "spread": summed(sure * (1 - sure)),
    }
