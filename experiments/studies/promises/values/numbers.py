"""Numbers from the same hypervectors: of bins of the value, and by regression."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sklearn.decomposition import KernelPCA
from sklearn.linear_model import RidgeCV
from torch import Tensor

from baselines.bank import Bank
from experiments.records.rows import Row
from hdc import HDCClassifier, HDCRegressor
from hdc.readouts import Majority

PENALTIES = 10.0 ** np.arange(-4, 5)
"""Penalties that ridge regression tries, in units of the mean square of a centred frame."""
REGRESSORS = {"regressor": "ridge", "nearest_neighbour": "neighbours"}
"""Read-outs of the library's regressor."""


def answers(
    bank: Bank, y: np.ndarray, queries: np.ndarray, truth: np.ndarray, bins: int
) -> Iterator[Row]:
    """The mean absolute ``error`` of each model without intervals, trained on the first frames.

    Args:
        bank: all frames.
        y: values of the training frames [n].
        queries: indices of the frames asked for [Q].
        truth: their values [Q].
        bins: prototypes, one a bin of the value; bins hold as many frames each.
    """
    train = np.arange(len(y))
    found = {
        "mean": np.full(len(queries), y.mean()),
        "bins": binned(bank, y, queries, bins),
        "ridge_greys": ridge_values(*bank.kernel(train, queries, "unit_centred"), y),
    }
    for model, answer in found.items():
        yield {"model": model, "error": float(np.abs(answer - truth).mean())}


def intervals(
    bank: Bank, y: np.ndarray, queries: np.ndarray, truth: np.ndarray, alpha: float
) -> Iterator[Row]:
    """The ``error`` of each regressor, the share of values ``inside`` its intervals, and their
    mean ``width``; arguments as of :func:`answers`, and ``alpha``, the share outside asked for."""
    asked = bank.at(queries)
    for name, readout in REGRESSORS.items():
        model = HDCRegressor(readout=readout).fit(bank.at(np.arange(len(y))), y)
        answer, low, high = model.predict(asked, True, alpha)
        yield {
            "model": name,
            "error": float(np.abs(answer - truth).mean()),
            "inside": float(((low <= truth) & (truth <= high)).mean()),
            "width": float((high - low).mean()),
        }


def binned(bank: Bank, y: np.ndarray, queries: np.ndarray, bins: int) -> np.ndarray:
    """The mean value of the bin whose prototype is nearest."""
    edges = np.unique(np.quantile(y, np.linspace(0, 1, bins + 1)[1:-1]))
    places = np.searchsorted(edges, y, side="right")
    filled, bin_of = np.unique(places, return_inverse=True)
    means = np.array([y[bin_of == k].mean() for k in range(len(filled))])
    model = HDCClassifier(readout=Majority(class_weight="balanced"))
    model.fit(bank.at(np.arange(len(y))), bin_of)
    return means[model.predict(bank.at(queries))]


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
