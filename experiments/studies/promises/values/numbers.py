"""Numbers from the same hypervectors: of bins of the value, and by regression."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sklearn.decomposition import KernelPCA
from sklearn.linear_model import RidgeCV
from torch import Tensor

from baselines.bank import Bank, Rows
from experiments.records.rows import Row
from hdc import HDCClassifier, HDCRegressor
from hdc.readouts import Majority

PENALTIES = 10.0 ** np.arange(-4, 5)
"""Penalties that ridge regression tries, in units of the mean square of a centred frame."""
REGRESSORS = {"regressor": "ridge", "nearest_neighbour": "neighbours"}
"""Read-outs of the library's regressor."""


def answers(
    bank: Bank,
    y: np.ndarray,
    queries: np.ndarray,
    truth: np.ndarray,
    bins: int,
    alpha: float,
) -> Iterator[Row]:
    """The mean absolute ``error`` of each model that is trained on the first frames; of the
    library's regressors also the share of values ``inside`` their intervals, and the mean
    ``width``.

    Args:
        bank: all frames.
        y: values of the training frames [n].
        queries: indices of the frames asked for [Q].
        truth: their values [Q].
        bins: prototypes, one a bin of the value; bins hold as many frames each.
        alpha: share of values that may lie outside the intervals.
    """
    train = np.arange(len(y))
    learned, asked = bank.at(train), bank.at(queries)

    def row(model: str, answer: np.ndarray) -> Row:
        return {"model": model, "error": float(np.abs(answer - truth).mean())}

    yield row("mean", np.full(len(queries), y.mean()))
    yield row("bins", binned(learned, y, asked, bins))
    products = bank.centred(train, queries)
    yield row("ridge_greys", ridge_values(*products, y))
    for name, readout in REGRESSORS.items():
        model = HDCRegressor(readout=readout).fit(learned, y)
        answer, low, high = model.predict(asked, True, alpha)
        yield {
            **row(name, answer),
            "alpha": alpha,
            "inside": float(((low <= truth) & (truth <= high)).mean()),
            "width": float((high - low).mean()),
        }


def binned(learned: Rows, y: np.ndarray, asked: Rows, bins: int) -> np.ndarray:
    """The mean value of the bin whose prototype is nearest, for each of the frames asked for."""
    edges = np.quantile(y, np.linspace(0, 1, bins + 1)[1:-1])
    _, bin_of = np.unique(np.searchsorted(edges, y, side="right"), return_inverse=True)
    means = np.array([y[bin_of == k].mean() for k in range(bin_of.max() + 1)])
    model = HDCClassifier(readout=Majority(class_weight="balanced"))
    return means[model.fit(learned, bin_of).predict(asked)]


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
