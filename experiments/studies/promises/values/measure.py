"""Numbers instead of labels, and how often the library's guarantees hold.

The same hypervectors answer in mm, µm or refractive index: by prototypes of bins of the value, by
the nearest frame, by ridge regression, and by the library's :class:`hdc.HDCRegressor` with its
intervals. Sets of labels, rejection and intervals are promised for frames that come as the training
frames did: a random split keeps that promise, a split by time, session or position breaks it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from sklearn.decomposition import KernelPCA
from sklearn.linear_model import RidgeCV
from torch import Tensor

from experiments.protocol.data import scene_at
from experiments.protocol.evaluate import bank_of
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.settings import Split
from experiments.protocol.splits import draw_split, nested
from hdc import HDCClassifier, HDCRegressor
from hdc.bank import Bank

PENALTIES = 10.0 ** np.arange(-4, 5)
"""Penalties that ridge regression tries, in units of the mean square of a centred frame."""


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def values(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Split],
    seeds: Sequence[int] = (0,),
    n_train: Sequence[int] = (50, 200, 1000),
    draws: int = 3,
    most_test: int = 1000,
    bins: int = 10,
    alphas: Sequence[float] = (0.2, 0.1, 0.05),
    at_least: float | None = None,
) -> Iterator[Row]:
    """One row: mean absolute ``error`` of one model's answers to ``n_test`` frames, in ``unit`` of
    the first value of the scene; of the library's regressor also the share of the values inside its
    intervals and their mean width, lists over ``alpha``. Frames of values below ``at_least`` are
    left out: above its surface, a fibre's actuator presses nothing.

    Arguments: configs/experiment/values.yaml.
    """
    for recording, row, pool, test in parts(
        run, scene, splits, seeds, draws, most_test
    ):
        seed = row["seed"]
        known: Any = recording  # a cached scene has frames and labels alone
        if not hasattr(recording, "values"):
            known = scene_at(scene, seed, False, run.console)
        numbers = known.values[:, 0]
        if at_least is not None:
            pool = pool[numbers[pool] >= at_least]
            test = test[numbers[test] >= at_least]
        random = np.random.default_rng((seed, row["draw"], 1))
        order = random.permutation(pool)
        sizes = [n for n in n_train if n <= len(order)]
        train = order[: max(sizes)]
        bank = bank_of(recording, np.concatenate([train, test]))
        queries = np.arange(len(train), len(bank))
        truth = numbers[test]
        row["n_test"] = len(test)
        row["value"] = known.value_names[0]
        row["unit"] = known.units[0]
        for n in sizes:
            y = numbers[train[:n]]
            of_models = answers(bank, y, queries, bins)
            for model, answer in of_models.items():
                error = float(np.abs(answer - truth).mean())
                yield {**row, "n": n, "model": model, "error": error}
            of_regressor = regressor(bank, y, queries, truth, alphas)
            yield {**row, "n": n, "model": "regressor", **of_regressor}


@experiment(revision=3, uses=("hdc.HDCClassifier",))
def coverage(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Split],
    seeds: Sequence[int] = (0,),
    n_per_class: Sequence[int] = (40,),
    draws: int = 5,
    most_test: int = 100,
    alphas: Sequence[float] = (0.2, 0.1, 0.05),
) -> Iterator[Row]:
    """One row: the share ``covered`` of ``n_test`` held-out frames whose label is in the library's
    prediction set after ``n`` frames of every class, the mean ``size`` of the set, the share
    ``refused`` (empty sets), and of frames of no class (None without any) the share
    ``unknown_refused``: lists over ``alpha``.

    Arguments: configs/experiment/coverage.yaml.
    """
    for recording, row, pool, test in parts(
        run, scene, splits, seeds, draws, most_test
    ):
        key = row["seed"], row["draw"]
        order, _ = nested(pool, recording.labels, [], key)
        least = min(map(len, order))
        for n in sorted({min(n, least) for n in n_per_class}):
            train = np.concatenate([of_class[:n] for of_class in order])
            model = HDCClassifier()
            model.fit(recording.frames(train), recording.labels[train])
            yield {**row, "n": n, **_promises(model, recording, test, alphas, key)}


def _promises(
    model: HDCClassifier,
    recording: Any,
    test: np.ndarray,
    alphas: Sequence[float],
    key: tuple[int, int],
) -> Row:
    """What a model answers to held-out frames, and to as many of no class."""
    frames, labels = recording.frames(test), recording.labels[test]
    row: Row = {"n_test": len(test), "alpha": list(alphas)}
    row["accuracy"] = model.score(frames, labels)
    with warnings.catch_warnings():
        # That few frames refuse nothing is what is measured here.
        warnings.filterwarnings("ignore", message=".*no frame is refused")
        sets = [model.predict_set(frames, alpha) for alpha in alphas]
        row["unknown_refused"] = [None for _ in alphas]
        others = getattr(recording, "unknown", None)
        if others is not None:
            some = np.random.default_rng(key).permutation(len(others.labels))
            strange = others.frames(some[: len(test)])
            row["unknown_refused"] = refused_shares(model, strange, alphas)
    row["covered"] = [covered(of_alpha, labels) for of_alpha in sets]
    row["size"] = [_mean(map(len, of_alpha)) for of_alpha in sets]
    row["refused"] = [empty(of_alpha) for of_alpha in sets]
    return row


def refused_shares(
    model: HDCClassifier, frames: Tensor, alphas: Sequence[float]
) -> list[float]:
    """Share of frames that a model does not know, for each share of known ones lost so."""
    return [_mean(~model.is_known(frames, alpha)) for alpha in alphas]


def covered(sets: Sequence[np.ndarray], labels: np.ndarray) -> float:
    """Share of sets of labels that hold the right one."""
    return _mean(label in one for one, label in zip(sets, labels, strict=True))


def empty(sets: Sequence[np.ndarray]) -> float:
    """Share of sets without a label."""
    return _mean(len(one) == 0 for one in sets)


def parts(
    run: Run,
    scene: Any,
    splits: Mapping[str, Split],
    seeds: Sequence[int],
    draws: int,
    most_test: int,
) -> Iterator[tuple[Any, Row, np.ndarray, np.ndarray]]:
    """Every draw of every split: the recording, the row's start, indices to learn and to test."""
    for seed, recording in run.scenes(scene, seeds):
        for split, wanted in splits.items():
            for draw in range(draws):
                pool, test = draw_split(recording, wanted, (seed, draw), most_test)
                row: Row = {"origin": recording.origin, "seed": seed}
                row |= {"split": split, "draw": draw}
                yield recording, row, pool, test
        run.note(f"seed {seed}")


def answers(
    bank: Bank,
    y: np.ndarray,
    queries: np.ndarray,
    bins: int,
) -> dict[str, np.ndarray]:
    """Numbers [Q] of the queries by each model of the first frames, whose values are y [n].

    Args:
        bank: all frames.
        y: values of the training frames.
        queries: indices of the frames asked for.
        bins: prototypes, one a bin of the value; bins hold as many frames each.
    """
    train = np.arange(len(y))
    asked = bank.at(queries)
    nearest = HDCRegressor(readout="neighbours").fit(bank.at(train), y)
    of_bits = bank.kernel(train, queries, "bits")
    of_greys = bank.kernel(train, queries, "unit_centred")
    return {
        "mean": np.full(len(queries), y.mean()),
        "bins": binned(bank, y, queries, bins),
        "nearest_neighbour": nearest.predict(asked),
        "ridge_bits": ridge_values(*of_bits, y),
        "ridge_greys": ridge_values(*of_greys, y),
    }


def binned(
    bank: Bank,
    y: np.ndarray,
    queries: np.ndarray,
    bins: int,
) -> np.ndarray:
    """The mean value of the bin whose prototype is nearest."""
    train = np.arange(len(y))
    inner = np.linspace(0, 1, bins + 1)[1:-1]
    edges = np.unique(np.quantile(y, inner))
    places = np.searchsorted(edges, y, side="right")
    filled, bin_of = np.unique(places, return_inverse=True)
    means = [y[bin_of == k].mean() for k in range(len(filled))]
    centres = np.array(means)
    model = HDCClassifier().fit(bank.at(train), bin_of)
    return centres[model.predict(bank.at(queries))]


def regressor(
    bank: Bank,
    y: np.ndarray,
    queries: np.ndarray,
    truth: np.ndarray,
    alphas: Sequence[float],
) -> Row:
    """Error, coverage and width of the library's regressor of the first frames [n]."""
    train = np.arange(len(y))
    asked = bank.at(queries)
    model = HDCRegressor().fit(bank.at(train), y)
    inside, width = [], []
    for alpha in alphas:
        answer, low, high = model.predict(asked, True, alpha)
        holds = (low <= truth) & (truth <= high)
        inside.append(float(holds.mean()))
        width.append(float((high - low).mean()))
    error = float(np.abs(answer - truth).mean())
    return {
        "error": error,
        "alpha": list(alphas),
        "covered": inside,
        "width": width,
    }


def ridge_values(
    inside: Tensor,
    across: Tensor,
    y: np.ndarray,
) -> np.ndarray:
    """Ridge regression of numbers with the penalty of least leave-one-out error.

    It is that of the frames themselves, whose weights lie in the span of the training frames.

    Args:
        inside, across: products of training frames [N, N], of queries with them [Q, N].
        y: numbers of the training frames [N].
    """
    span = KernelPCA(kernel="precomputed", remove_zero_eig=True)
    coordinates = span.fit_transform(inside.numpy())
    squares = coordinates**2
    unit = float(squares.sum()) / len(y)
    model = RidgeCV(alphas=unit * PENALTIES).fit(coordinates, y)
    return model.predict(span.transform(across.numpy()))


def _mean(numbers: Iterable[float]) -> float:
    return float(np.mean(list(numbers)))
