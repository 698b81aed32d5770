"""Numbers instead of labels, and how often the library's guarantees hold.

The same hypervectors answer in mm, µm or refractive index: by prototypes of bins of the value, by
the nearest frame, by ridge regression, and by the library's :class:`hdc.HDCRegressor` with its
intervals. Sets of labels, rejection and intervals are promised for frames that come as the training
frames did: a random split keeps that promise, a split by time, session or position breaks it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import contains
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.dual import Products
from experiments.protocol.data import scene_at
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.recordings.measure import draw_split, nested
from hdc import HDCClassifier, HDCRegressor, bits
from hdc.encode import encode
from hdc.readout import PENALTIES


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def values(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Mapping[str, Any]],
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
            pool, test = (part[numbers[part] >= at_least] for part in (pool, test))
        order = np.random.default_rng((seed, row["draw"], 1)).permutation(pool)
        train = order[: max(n for n in n_train if n <= len(order))]
        images = recording.frames(np.concatenate([train, test])).cpu()
        words, queries = encode(images), np.arange(len(train), len(images))
        products = Products(images, np.zeros(len(images), np.int64), 1)
        row |= {
            "n_test": len(test),
            "value": known.value_names[0],
            "unit": known.units[0],
        }
        for n in (n for n in n_train if n <= len(train)):
            y, truth = numbers[train[:n]], numbers[test]
            for model, answer in answers(
                images, words, products, y, queries, bins
            ).items():
                error = float(np.abs(answer - truth).mean())
                yield {**row, "n": n, "model": model, "error": error}
            of = regressor(images, y, queries, truth, alphas)
            yield {**row, "n": n, "model": "regressor", **of}


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def coverage(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Mapping[str, Any]],
    seeds: Sequence[int] = (0,),
    n_per_class: int = 40,
    draws: int = 5,
    most_test: int = 100,
    alphas: Sequence[float] = (0.2, 0.1, 0.05),
) -> Iterator[Row]:
    """One row: the share ``covered`` of ``n_test`` held-out frames whose label is in the library's
    prediction set, the mean ``size`` of the set, the share ``refused`` (empty sets), and of frames
    of no class (None without any) the share ``unknown_refused``: lists over ``alpha``.

    Arguments: configs/experiment/coverage.yaml.
    """
    for recording, row, pool, test in parts(
        run, scene, splits, seeds, draws, most_test
    ):
        key = row["seed"], row["draw"]
        order, _ = nested(pool, recording.labels, [], key)
        n = min(n_per_class, *map(len, order))
        train = np.concatenate([of[:n] for of in order])
        model = HDCClassifier().fit(recording.frames(train), recording.labels[train])
        frames, labels = recording.frames(test), recording.labels[test].tolist()
        sets = [[s.tolist() for s in model.predict_set(frames, a)] for a in alphas]
        row |= {
            "n": n, "n_test": len(test), "alpha": list(alphas),
            "accuracy": model.score(frames, labels),
            "covered": [_mean(map(contains, of, labels)) for of in sets],
            "size": [_mean(map(len, of)) for of in sets],
            "refused": [_mean(not s for s in of) for of in sets],
            "unknown_refused": [None for _ in alphas],
        }  # fmt: skip
        if (others := getattr(recording, "unknown", None)) is not None:
            some = np.random.default_rng(key).permutation(len(others.labels))
            strange = others.frames(some[:most_test])
            row["unknown_refused"] = [
                _mean(~model.is_known(strange, a)) for a in alphas
            ]
        yield row


def parts(
    run: Run, scene: Any, splits: Any, seeds: Sequence[int], draws: int, most_test: int
) -> Iterator[tuple[Any, Row, np.ndarray, np.ndarray]]:
    """Every draw of every split: the recording, the row's start, indices to learn and to test."""
    for seed, recording in run.scenes(scene, seeds):
        for split, key in splits.items():
            for draw in range(draws):
                pool, test = draw_split(recording, key, (seed, draw), most_test)
                row = {
                    "origin": recording.origin,
                    "seed": seed,
                    "split": split,
                    "draw": draw,
                }
                yield recording, row, pool, test
        run.note(f"seed {seed}")


def answers(
    images: Tensor,
    words: Tensor,
    products: Products,
    y: np.ndarray,
    queries: np.ndarray,
    bins: int,
) -> dict[str, np.ndarray]:
    """Numbers [Q] of the queries by each model of the first frames, whose values are y [n].

    Args:
        images, words, products: all frames uint8 [N, H, W], their hypervectors and products.
        y: values of the training frames.
        queries: indices of the frames asked for.
        bins: prototypes, one a bin of the value; bins hold as many frames each.
    """
    train = np.arange(len(y))
    edges = np.unique(np.quantile(y, np.linspace(0, 1, bins + 1)[1:-1]))
    of = np.unique(np.searchsorted(edges, y, side="right"), return_inverse=True)[1]
    centres = np.array([y[of == k].mean() for k in range(of.max() + 1)])
    nearest = bits.hamming(words[queries], words[train]).argmin(1).numpy()
    found = {
        "mean": np.full(len(queries), y.mean()),
        "bins": centres[
            HDCClassifier().fit(images[train], of).predict(images[queries])
        ],
        "nearest_neighbour": y[nearest],
    }
    for name, pixels in (("ridge_bits", "bits"), ("ridge_greys", "unit")):
        found[name] = ridge_values(*products.centred(train, queries, pixels), y)
    return found


def regressor(
    images: Tensor,
    y: np.ndarray,
    queries: np.ndarray,
    truth: np.ndarray,
    alphas: Sequence[float],
) -> Row:
    """Error, coverage and width of the library's regressor of the first frames [n]."""
    model, covered, width = HDCRegressor().fit(images[: len(y)], y), [], []
    for alpha in alphas:
        answer, low, high = model.predict(images[queries], True, alpha)
        covered.append(float(((low <= truth) & (truth <= high)).mean()))
        width.append(float((high - low).mean()))
    error = float(np.abs(answer - truth).mean())
    return {"error": error, "alpha": list(alphas), "covered": covered, "width": width}


def ridge_values(inside: Tensor, across: Tensor, y: np.ndarray) -> np.ndarray:
    """Ridge regression of numbers with the penalty of least leave-one-out error.

    Args:
        inside, across: centred products of training frames [N, N], of queries with them [Q, N].
        y: numbers of the training frames [N].
    """
    spectrum, vectors = torch.linalg.eigh(inside)
    spectrum, centred = spectrum.clamp(min=0), torch.from_numpy(y - y.mean())
    best, rotated = (np.inf, centred), vectors.T @ centred
    for penalty in (float(spectrum.mean()) * p for p in PENALTIES):
        kept = penalty / (spectrum + penalty)
        left = (vectors**2 @ kept - 1 / len(y)).clamp(min=1e-9)
        error = float(((vectors @ (kept * rotated) / left) ** 2).sum())
        if error < best[0]:
            best = error, vectors @ (rotated / (spectrum + penalty))
    return (across @ best[1] + y.mean()).numpy()


def _mean(numbers: Iterable[float]) -> float:
    return float(np.mean(list(numbers)))
