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


@experiment
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
    for seed, recording in run.scenes(scene, seeds):
        known: Any = recording  # a cached scene has frames and labels alone
        if not hasattr(recording, "values"):
            known = scene_at(scene, seed, False, run.console)
        numbers, about = known.values[:, 0], (known.value_names[0], known.units[0])
        for split, key in splits.items():
            for draw in range(draws):
                parts = draw_split(recording, key, (seed, draw), most_test)
                if at_least is not None:
                    parts = tuple(part[numbers[part] >= at_least] for part in parts)
                pool, test = parts
                order = np.random.default_rng((seed, draw, 1)).permutation(pool)
                train = order[: max(n for n in n_train if n <= len(order))]
                images = recording.frames(np.concatenate([train, test])).cpu()
                answers = Answers(images, np.concatenate([numbers[train], numbers[test]]))
                queries = np.arange(len(train), len(images))
                for n in (n for n in n_train if n <= len(train)):
                    row = {
                        "origin": recording.origin, "seed": seed, "split": split, "draw": draw,
                        "n": n, "n_test": len(test), "value": about[0], "unit": about[1],
                    }  # fmt: skip
                    for model, answer in answers.of(np.arange(n), queries, bins).items():
                        error = float(np.abs(answer - numbers[test]).mean())
                        yield {**row, "model": model, "error": error}
                    yield {**row, "model": "regressor", **answers.regressor(n, queries, alphas)}
        run.note(f"seed {seed}")


@experiment
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
    for seed, recording in run.scenes(scene, seeds):
        others = getattr(recording, "unknown", None)
        for split, key in splits.items():
            for draw in range(draws):
                pool, test = draw_split(recording, key, (seed, draw), most_test)
                order, _ = nested(pool, recording.labels, [], (seed, draw))
                n = min(n_per_class, *map(len, order))
                train = np.concatenate([of[:n] for of in order])
                model = HDCClassifier().fit(recording.frames(train), recording.labels[train])
                frames, labels = recording.frames(test), recording.labels[test].tolist()
                sets = [[s.tolist() for s in model.predict_set(frames, a)] for a in alphas]
                row = {
                    "origin": recording.origin, "seed": seed, "split": split, "draw": draw,
                    "n": n, "n_test": len(test), "alpha": list(alphas),
                    "accuracy": model.score(frames, labels),
                    "covered": [_mean(map(contains, of, labels)) for of in sets],
                    "size": [_mean(map(len, of)) for of in sets],
                    "refused": [_mean(not s for s in of) for of in sets],
                    "unknown_refused": [None for _ in alphas],
                }  # fmt: skip
                if others is not None:
                    some = np.random.default_rng((seed, draw)).permutation(len(others.labels))
                    strange = others.frames(some[:most_test])
                    known = [model.is_known(strange, alpha) for alpha in alphas]
                    row["unknown_refused"] = [_mean(~k) for k in known]
                yield row
        run.note(f"seed {seed}")


class Answers:
    """Numbers for some frames by models of others.

    Args:
        images: frames uint8 [N, H, W].
        numbers: their values float64 [N].
    """

    def __init__(self, images: Tensor, numbers: np.ndarray):
        self.images, self.numbers = images, numbers
        self.words = encode(images)
        self.products = Products(images, np.zeros(len(images), np.int64), 1)

    def of(self, train: np.ndarray, queries: np.ndarray, bins: int) -> dict[str, np.ndarray]:
        """Numbers [Q] of the queries by each model of the training frames."""
        y = self.numbers[train]
        nearest = bits.hamming(self.words[queries], self.words[train]).argmin(1).numpy()
        answers = {
            "mean": np.full(len(queries), y.mean()),
            "bins": self._of_bins(train, queries, bins),
            "nearest_neighbour": y[nearest],
        }
        for name, pixels in (("ridge_bits", "bits"), ("ridge_greys", "unit")):
            answers[name] = ridge_values(*self.products.centred(train, queries, pixels), y)
        return answers

    def _of_bins(self, train: np.ndarray, queries: np.ndarray, bins: int) -> np.ndarray:
        """Mean value of the bin whose prototype is nearest; bins hold as many frames each."""
        y = self.numbers[train]
        edges = np.unique(np.quantile(y, np.linspace(0, 1, bins + 1)[1:-1]))
        of = np.unique(np.searchsorted(edges, y, side="right"), return_inverse=True)[1]
        centres = np.array([y[of == k].mean() for k in range(of.max() + 1)])
        model = HDCClassifier().fit(self.images[train], of)
        return centres[model.predict(self.images[queries])]

    def regressor(self, n: int, queries: np.ndarray, alphas: Sequence[float]) -> Row:
        """Error, coverage and width of the library's regressor of the first n frames."""
        model = HDCRegressor().fit(self.images[:n], self.numbers[:n])
        truth, covered, width = self.numbers[queries], [], []
        for alpha in alphas:
            answer, low, high = model.predict(self.images[queries], True, alpha)
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
