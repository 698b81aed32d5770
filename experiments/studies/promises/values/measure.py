"""Numbers instead of labels, and how often the library's guarantees hold.

Sets of labels, intervals and probabilities are promised for frames recorded under the training
conditions: a random split of one session keeps to them, a split by time, session or position does
not.
"""

from __future__ import annotations

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
from experiments.studies.promises.values.numbers import answers, intervals
from hdc import HDCClassifier

BINS = 10
"""Bins of equal width of the probability of an answer."""


class Values(Task, frozen=True):
    """One row: mean absolute ``error`` of one model's answers to ``n_test`` frames, in ``unit`` of
    the first value of the scene; of the library's regressor also the share of the values ``inside``
    its intervals for ``alpha`` and their mean ``width``. Frames of values below ``at_least`` are
    left out: above its surface, a fibre's actuator presses nothing.

    Arguments: configs/experiment/values.yaml.
    """

    revision: ClassVar = 2
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    splits: Mapping[str, Split]
    seeds: Sequence[int] = (0,)
    n_train: Sequence[int] = (50, 200, 1000)
    draws: int = 3
    most_test: int = 1000
    bins: int = 10
    alpha: float | int = 0.1
    at_least: float | int | None = None

    def rows(self, context: Context) -> Iterator[Row]:
        for recording, row, pool, test in parts(
            context, self.scene, self.splits, self.seeds, self.draws, self.most_test
        ):
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
            asked = np.arange(len(train), len(bank)), numbers[test]
            row |= {"value": known.value_names[0], "unit": known.units[0]}
            row["n_test"] = len(test)
            for n in sizes:
                y = numbers[train[:n]]
                for found in answers(bank, y, *asked, self.bins):
                    yield {**row, "n": n, **found}
                for found in intervals(bank, y, *asked, self.alpha):
                    yield {**row, "n": n, "alpha": self.alpha, **found}


class Coverage(Task, frozen=True):
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

    scene: Mapping[str, Any]
    splits: Mapping[str, Split]
    models: Mapping[str, Any]
    seeds: Sequence[int] = (0,)
    n_per_class: Sequence[int] = (1, 2, 5, 10, 20, 50)
    draws: int = 3
    most_test: int = 200
    alpha: float | int = 0.1

    def rows(self, context: Context) -> Iterator[Row]:
        asked = models_of(at_seed(self.models, 0))
        for recording, row, pool, test in parts(
            context, self.scene, self.splits, self.seeds, self.draws, self.most_test
        ):
            key = row["seed"], row["draw"]
            order, _ = nested(pool, recording.labels, [], key)
            least = min(map(len, order))
            sizes = sorted({min(n, least) for n in self.n_per_class})
            most = np.concatenate([of_class[: sizes[-1]] for of_class in order])
            bank = bank_of(recording, np.concatenate([most, test]))
            queries = bank.at(np.arange(len(most), len(bank)))
            labels = recording.labels[test]
            row |= {"n_test": len(test), "alpha": self.alpha}
            for n in sizes:
                place = np.arange(len(most)) % sizes[-1]
                train = np.flatnonzero(place < n)
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


def parts(
    context: Context,
    scene: Any,
    splits: Mapping[str, Split],
    seeds: Sequence[int],
    draws: int,
    most_test: int,
) -> Iterator[tuple[Any, Row, np.ndarray, np.ndarray]]:
    """Every draw of every split: the recording, the row's start, indices to learn and to test."""
    for seed, recording in context.scenes(scene, seeds):
        for split, wanted in splits.items():
            for draw in range(draws):
                pool, test = resample_split(recording, wanted, (seed, draw), most_test)
                row: Row = {"origin": recording.origin, "seed": seed}
                row |= {"split": split, "draw": draw}
                yield recording, row, pool, test
        context.note(f"seed {seed}")
