"""Numbers instead of labels, and how often the library's guarantees hold.

Sets of labels, intervals and probabilities are promised for frames recorded under the training
conditions: a random split of one session keeps to them, a split by time, session or position does
not.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from sklearn.decomposition import KernelPCA
from sklearn.linear_model import RidgeCV
from torch import Tensor

from baselines.bank import Bank
from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import bank_of
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.protocol.task import Context, Row, Task
from hdc import HDCClassifier, HDCRegressor

BINS = 10
"""Bins of equal width of the probability of an answer."""
PENALTIES = 10.0 ** np.arange(-4, 5)
"""Penalties that ridge regression tries, in units of the mean square of a centred frame."""


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
    its intervals for ``alpha``.

    Arguments: configs/experiment/values.yaml.
    """

    revision: ClassVar = 3
    uses: ClassVar = ("hdc.HDCClassifier",)

    splits: Mapping[str, Split]
    n_train: Sequence[int]
    alpha: float | int

    def rows(self, context: Context) -> Iterator[Row]:
        anew = replace(context, cache=False)  # a cached scene has no values
        for recording, row, pool, test in self.parts(anew, self.splits):
            numbers = recording.values[:, 0]
            random = np.random.default_rng((row["seed"], row["draw"], 1))
            order = random.permutation(pool)
            sizes = [n for n in self.n_train if n <= len(order)]
            train = order[: max(sizes)]
            bank = bank_of(recording, np.concatenate([train, test]))
            queries = np.arange(len(train), len(bank))
            row |= {"value": recording.value_names[0], "unit": recording.units[0]}
            row["n_test"] = len(test)
            for n in sizes:
                given = bank, numbers[train[:n]], queries, numbers[test]
                for found in answers(*given, self.alpha):
                    yield {**row, "n": n, **found}


def answers(
    bank: Bank, y: np.ndarray, queries: np.ndarray, truth: np.ndarray, alpha: float
) -> Iterator[Row]:
    """The mean absolute ``error`` of the mean, of ridge regression on grey values, and of the
    library's regressor, of which also the share of values ``inside`` its intervals.

    Args:
        bank: all frames, of which the first train.
        y: values of the training frames [n].
        queries: indices of the frames asked for [Q].
        truth: their values [Q].
        alpha: share of values that may lie outside the intervals.
    """
    train = np.arange(len(y))
    products = bank.centred(train, queries)
    model = HDCRegressor(readout="ridge").fit(bank.at(train), y)
    answer, low, high = model.predict(bank.at(queries), True, alpha)
    inside = float(((low <= truth) & (truth <= high)).mean())
    for name, found, more in (
        ("mean", y.mean(), {}),
        ("ridge_greys", ridge_values(*products, y), {}),
        ("regressor", answer, {"alpha": alpha, "inside": inside}),
    ):
        yield {"model": name, "error": float(np.abs(found - truth).mean()), **more}


def ridge_values(inside: Tensor, across: Tensor, y: np.ndarray) -> np.ndarray:
    """Ridge regression of numbers with the penalty of least leave-one-out error.

    It is that of the frames themselves, whose weights lie in the span of the training frames.

    Args:
        inside, across: products of training frames [N, N], of queries with them [Q, N].
        y: numbers of the training frames [N].
    """
    span = KernelPCA(kernel="precomputed", remove_zero_eig=True)
    coordinates = span.fit_transform(inside.numpy())
    unit = float((coordinates**2).sum()) / len(y)
    model = RidgeCV(alphas=unit * PENALTIES).fit(coordinates, y)
    return model.predict(span.transform(across.numpy()))


class Coverage(Drawn, frozen=True):
    """One row: a model in one draw of one split after ``n`` frames of every class.

    The share ``covered`` of ``n_test`` held-out frames by the model's prediction set for ``alpha``,
    and the mean ``size`` of the set. Lists over :data:`BINS` bins of the probability of an answer:
    how many ``answers``, how many of them ``right``, and the sum ``sure`` of their probabilities;
    none after one frame, which fits no probability.
    Arguments: configs/experiment/coverage.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """

    revision: ClassVar = 6

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
    held = [label in one for one, label in zip(found, labels, strict=True)]
    return {
        "covered": float(np.mean(held)),
        "size": float(np.mean([len(one) for one in found])),
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
    }
