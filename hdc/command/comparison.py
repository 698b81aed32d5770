"""``hdc compare``: read-outs of bits and of grey values on frames of one's own.

Methods see inner products of the N frames. For an L2 penalty a linear model lies in the span of its
training frames, so scikit-learn's estimators solve it exactly from coordinates in that span, and a
fit of 120,000 pixels costs no more than one of N coordinates.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.table import Table
from sklearn.decomposition import KernelPCA
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.neighbors import NearestCentroid

from hdc import theory
from hdc.accuracy import wilson
from hdc.bits import hamming
from hdc.command.work import last_sessions, split
from hdc.encode import encode
from hdc.prototypes import Counters
from hdc.readers import Recording
from hdc.readers.recording import with_progress
from hdc.readout import gram

STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
COLUMNS = 2**13
"""Pixels that are made floats at a time."""


class Frames:
    """Packed hypervectors int64 [N, W], and inner products [N, N] by what they are of.

    ``products`` has those of hypervectors in ±1 ("bits") and of grey values in 0 … 1 ("greys").
    """

    def __init__(self, frames: np.ndarray) -> None:
        flat, most = (
            frames.reshape(len(frames), -1),
            np.float32(np.iinfo(frames.dtype).max),
        )
        n, self.pixels = flat.shape
        self.words = torch.cat(
            [encode(torch.from_numpy(frames[i : i + 32]), i) for i in range(0, n, 32)]
        )
        greys = np.zeros((n, n))
        for start in range(0, self.pixels, COLUMNS):
            block = flat[:, start : start + COLUMNS].astype(np.float32) / most
            greys += block @ block.T
        bits = gram(self.words, self.words, self.pixels).numpy()
        self.products = {"bits": bits, "greys": greys}


def coordinates(
    products: np.ndarray, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames in an orthonormal basis of the span of the centred training frames."""
    span = KernelPCA(kernel="precomputed", remove_zero_eig=True)
    trained = span.fit_transform(products[np.ix_(train, train)])
    queries = span.transform(products[np.ix_(test, train)])
    unit = np.sqrt(len(train)) / np.linalg.norm(
        trained
    )  # penalties mean the same everywhere
    return unit * trained, unit * queries


METHODS: dict[str, tuple[str, Any]] = {
    "prototype": ("bits", None),
    "ridge": ("bits", RidgeClassifierCV(np.logspace(-4, 2, 7))),
    "neighbours": ("bits", None),
    "mean image": ("greys", NearestCentroid()),
    "softmax": ("greys", LogisticRegression(C=10, max_iter=1000)),
}
"""Name → what it sees, and its estimator on coordinates (None: compares bits); smallest first."""


def predict(
    name: str, data: Frames, labels: np.ndarray, train: np.ndarray, test: np.ndarray
) -> np.ndarray:
    """Labels [Q] of the test frames, learnt from the training frames by one of METHODS."""
    sees, estimator = METHODS[name]
    if estimator is not None:
        trained, queries = coordinates(data.products[sees], train, test)
        with np.errstate(
            invalid="ignore"
        ):  # a deviation that one frame a class does not have
            return np.asarray(estimator.fit(trained, labels[train]).predict(queries))
    if name == "neighbours":
        return labels[train][data.products["bits"][np.ix_(test, train)].argmax(1)]
    counters = Counters(labels.max() + 1, data.pixels)
    counters.add(data.words[train], torch.from_numpy(labels[train]))
    prototypes = counters.prototypes(
        size=int(counters.n.min())
    )  # balanced, as hdc train is
    return hamming(data.words[test], prototypes).argmin(1).numpy()


def compare(
    recording: Recording,
    other: Recording | None,
    path: Path,
    fraction: float,
    draws: int,
) -> dict[str, Any]:
    """Train and test every method at each number of frames per class.

    The result is what --json writes: a curve for each split and method. `other` has frames of
    another day to test on, and `fraction` is the share of frames held out.
    """
    parts = [recording, *([other] if other else [])]
    names, n = [name for part in parts for name in part.names], len(recording)
    known = [name for name in recording.classes if name in set(names[:n])]
    if unknown := sorted(set(names) - set(known)):
        raise ValueError(
            f"--test: expected classes among {', '.join(known)}, found {unknown[0]}"
        )
    labels = np.array([known.index(name) for name in names])
    first = recording[0]
    if other and (other[0].shape, other[0].dtype) != (first.shape, first.dtype):
        raise ValueError(
            f"--test: expected frames {first.shape} {first.dtype} as in the first recording, "
            f"found {other[0].shape} {other[0].dtype}"
        )
    stream = (frame for part in parts for frame in part.stream())
    data = Frames(np.stack(list(with_progress(stream, len(names), "Reading"))))
    every = np.arange(len(names))
    if other:
        later = every[:n], every[n:]
    elif (last := last_sessions(recording, fraction)) is not None:
        later = every[~last], every[last]
    else:
        later = split(labels, fraction, 0, recording.order)
    random = [split(labels[:n], fraction, seed) for seed in range(draws)]
    splits = {
        "random": _curves(data, labels, random),
        "other recording" if other else "ordered": _curves(
            data, labels, [later] * draws
        ),
    }
    return {
        "recording": str(path), "frames": n, "classes": known, "shape": list(first.shape),
        "test_fraction": fraction, "draws": draws, "splits": splits, "advice": advice(splits),
        "expected": expected(data, labels[:n]),
    }  # fmt: skip


def expected(data: Frames, labels: np.ndarray) -> dict[int, float]:
    """Frames a class, all and more, and the accuracy that :mod:`hdc.theory` expects of prototypes.

    It is that of the random split. Nothing is expected of fewer than three frames, or equal ones.
    """
    n, counts = len(labels), np.bincount(labels)
    if counts.min() < 3:
        return {}
    with np.errstate(divide="ignore", invalid="ignore"):
        moments = theory.correlations(
            data.products["bits"][:n, :n] / data.pixels, labels
        )
    sizes = [
        n // len(counts) * times
        for times in (1, 2, 10)
        if np.isfinite(moments.skew).all()
    ]
    return {
        k: theory.hdc_accuracy(moments, k * len(counts), data.pixels) for k in sizes
    }


def _curves(
    data: Frames, labels: np.ndarray, splits: list[tuple[np.ndarray, np.ndarray]]
) -> dict[str, Any]:
    """Accuracy of each method at 1, 2, 5 … frames per class and at all, with its Wilson interval.

    A test frame that several draws tested counts once, with the mean of its right answers.
    """
    classes, counts = np.unique(labels[splits[0][0]], return_counts=True)
    curves: dict[str, Any] = {name: [] for name in METHODS}
    for size in [n for n in STEPS if n < counts.min()] + [0]:  # 0: all training frames
        chosen = []
        for seed, (train, test) in enumerate(splits):
            rng = np.random.default_rng([seed, size])
            members = [
                rng.permutation(train[labels[train] == c])[: size or None]
                for c in classes
            ]
            chosen.append((np.sort(np.concatenate(members)), test))
        for name, curve in curves.items():
            right, tested = np.zeros(len(labels)), np.zeros(len(labels))
            for train, test in chosen:
                right[test] += predict(name, data, labels, train, test) == labels[test]
                tested[test] += 1
            shares = right[tested > 0] / tested[tested > 0]
            low, high = wilson(shares.sum(), len(shares))
            curve.append(
                {"frames_a_class": len(chosen[0][0]) / len(classes), "accuracy": shares.mean(),
                 "low": low, "high": high, "tested": len(shares)}
            )  # fmt: skip
    return curves


def advice(splits: dict[str, Any]) -> str:
    """One sentence: the first of METHODS whose interval reaches the best accuracy, and why."""
    split_name, curves = list(splits.items())[-1]
    last = {name: curve[-1] for name, curve in curves.items()}
    best = max(last, key=lambda name: last[name]["accuracy"])
    name = next(
        name for name in METHODS if last[name]["high"] >= last[best]["accuracy"]
    )
    use = (
        f"hdc train --readout {name}"
        if METHODS[name][0] == "bits"
        else f"{name} on grey values"
    )
    others = ", ".join(f"{n} {last[n]['accuracy']:.0%}" for n in METHODS if n != name)
    return (
        f"Use {use}: on the {split_name} test frames {last[name]['accuracy']:.0%}, "
        f"the smallest model that is not clearly behind the best ({others})."
    )


def text(result: dict[str, Any]) -> str:
    """Learning curves, with the interval where all frames were learnt, and advice."""
    height, width = result["shape"]
    console = Console(width=120)
    with console.capture() as captured:
        for title, curves in result["splits"].items():
            counts = [f"{point['frames_a_class']:.3g}" for point in curves["prototype"]]
            table = Table(f"{title}, frames per class", "sees", *counts, box=None)
            for name, curve in curves.items():
                *cells, last = (f"{point['accuracy']:.0%}" for point in curve)
                interval = f" [{curve[-1]['low']:.0%}, {curve[-1]['high']:.0%}]"
                table.add_row(name, METHODS[name][0], *cells, last + interval)
            console.print(table, "")
    likely = ", ".join(f"{p:.0%} with {n}" for n, p in result["expected"].items())
    theory_says = (
        f"Theory expects of prototypes, random split: {likely} frames per class.\n\n"
    )
    return (
        f"{result['frames']} frames of {len(result['classes'])} classes, {width} × {height} "
        f"pixels, {result['test_fraction']:.0%} held out, {result['draws']} draws\n\n"
        f"{captured.get().rstrip()}\n\n{theory_says * bool(likely)}{result['advice']}"
    )
