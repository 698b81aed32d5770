"""Baselines outside the library: scikit-learn's models of grey values.

A model with an L2 penalty lies in the span of its training frames, and neighbours and kernels need
distances alone. So each baseline learns from coordinates in that span, which inner products give: a
fit of 120,000 pixels costs no more than one of N coordinates, and is the same.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.base import clone, is_classifier
from sklearn.dummy import DummyClassifier, DummyRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV, RidgeCV
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor, NearestCentroid
from sklearn.svm import SVC, SVR

from hdc import circular
from hdc.command.compare.frames import PIXELS, FrameBank
from hdc.selection import Frames

RIDGE_PENALTIES = np.logspace(-4, 2, 7)
C_VALUES = (1, 10, 100)
"""Settings of softmax and support vectors; the folds of the library's models choose among them."""
_NONE = 1e-10  # of the largest eigenvalue: what rounding leaves of none


@dataclass(frozen=True)
class Rival:
    """A model of grey values.

    Attributes:
        model: its name.
        pixels: one of PIXELS.
        setting: what it was given that the folds choose, in words; or nothing.
        estimator: of scikit-learn, untrained.
        view: what it learns from: ``"coordinates"``, or the kernel ``"rbf"``.
    """

    model: str
    pixels: str
    setting: str
    estimator: Any
    view: str = "coordinates"

    @property
    def name(self) -> str:
        return f"{self.model}{self.setting}, {self.pixels} greys"

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def keeps_frames(self) -> bool:
        """Whether it asks all training frames, and not weights that stand for them."""
        return self.view == "rbf" or self.model.endswith("-NN")

    def n_functions(self, frames: Frames) -> int:
        """How many linear functions of the pixels a linear model has."""
        if frames.values is not None:
            return frames.values.shape[1] * (1 if frames.period is None else 2)
        n = len(frames.names)
        return n * (n - 1) // 2 if self.model == "linear SVM" else n

    def answers(
        self, frames: Frames, train: np.ndarray, test: np.ndarray
    ) -> np.ndarray:
        assert isinstance(frames.bank, FrameBank)
        trained, queries = VIEWS[self.view](frames.bank, self.pixels, train, test)
        if frames.values is None:
            return self._predict(trained, frames.labels[train], queries)
        values, period = frames.values[train], frames.period
        if period is not None:
            values = circular.to_plane(values, period)
        middle, scale = values.mean(axis=0), values.std(axis=0)
        scale[scale == 0] = 1
        columns = [
            self._predict(trained, column, queries)
            for column in ((values - middle) / scale).T
        ]
        found = np.stack(columns, axis=1) * scale + middle
        if period is None:
            return found
        return circular.from_plane(found, period, bool((frames.values < 0).any()))

    def _predict(
        self, trained: np.ndarray, targets: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        estimator = clone(self.estimator)
        if not np.ptp(trained, axis=0).any():
            # Equal frames tell nothing apart, and some estimators refuse them.
            estimator = DummyRegressor()
            if is_classifier(self.estimator):
                estimator = DummyClassifier()
        neighbours = getattr(estimator, "n_neighbors", 1)
        if neighbours > len(trained):
            estimator.set_params(n_neighbors=len(trained))
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", ConvergenceWarning)
            warnings.simplefilter("ignore", UserWarning)  # classes without a deviation
            return np.asarray(estimator.fit(trained, targets).predict(queries))


def rivals(learns_values: bool) -> list[Rival]:
    """Every baseline on raw and on standardised frames, once per setting."""
    found = []
    for pixels in PIXELS:
        if learns_values:
            found += _of_values(pixels)
        else:
            found += _of_classes(pixels)
    return found


def _of_classes(pixels: str) -> list[Rival]:
    found = [
        Rival("mean image", pixels, "", NearestCentroid()),
        Rival("ridge", pixels, "", RidgeClassifierCV(RIDGE_PENALTIES)),
        Rival("1-NN", pixels, "", KNeighborsClassifier(1)),
        Rival("3-NN", pixels, "", KNeighborsClassifier(3)),
    ]
    for c in C_VALUES:
        setting = f" (C = {c})"
        softmax = LogisticRegression(C=c, max_iter=500)
        machine = SVC(kernel="precomputed", C=c)
        found += [
            Rival("softmax", pixels, setting, softmax),
            Rival("linear SVM", pixels, setting, SVC(kernel="linear", C=c)),
            Rival("rbf SVM", pixels, setting, machine, "rbf"),
        ]
    return found


def _of_values(pixels: str) -> list[Rival]:
    found = [
        Rival("ridge", pixels, "", RidgeCV(RIDGE_PENALTIES)),
        Rival("1-NN", pixels, "", KNeighborsRegressor(1)),
        Rival("3-NN", pixels, "", KNeighborsRegressor(3)),
    ]
    if pixels == "raw":
        found.insert(0, Rival("mean", pixels, "", DummyRegressor()))
    for c in C_VALUES:
        machine = SVR(kernel="precomputed", C=c, epsilon=0.01)
        found.append(Rival("SVR", pixels, f" (C = {c})", machine, "rbf"))
    return found


# Their input ----------------------------------------------------------------------------


def coordinates(
    bank: FrameBank, pixels: str, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames [n, r], [Q, r] in an orthonormal basis of the span of the centred training frames.

    The mean square length of the training frames is 1, so that penalties mean the same everywhere.
    """
    products = bank.products(pixels)
    inside, across = products[np.ix_(train, train)], products[np.ix_(test, train)]
    means, mean = inside.mean(axis=0), inside.mean()
    spectrum, vectors = np.linalg.eigh(inside - means - means[:, None] + mean)
    spans = spectrum > _NONE * max(spectrum[-1], 0)
    if not spans.any():  # all training frames are equal
        return np.zeros((len(train), 1)), np.zeros((len(test), 1))
    lengths, vectors = np.sqrt(spectrum[spans]), vectors[:, spans]
    trained = vectors * lengths
    own = across.mean(axis=1, keepdims=True)
    queries = (across - means - own + mean) @ (vectors / lengths)
    unit = np.sqrt(len(train)) / np.linalg.norm(trained)
    return unit * trained, unit * queries


def _coordinates_once(
    bank: FrameBank, pixels: str, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The same, kept for the baselines that follow on the same frames."""
    key = train.tobytes() + b"|" + test.tobytes()
    kept = bank.coordinates.get(pixels)
    if kept is None or kept[0] != key:
        kept = key, coordinates(bank, pixels, train, test)
        bank.coordinates[pixels] = kept
    return kept[1]


def rbf_kernel(
    bank: FrameBank, pixels: str, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """exp(−d²/s), with s the mean square distance of training frames from their mean."""
    products = bank.products(pixels)
    lengths = products.diagonal()
    inside, across = products[np.ix_(train, train)], products[np.ix_(test, train)]
    near = lengths[train] + lengths[train][:, None] - 2 * inside
    far = lengths[train] + lengths[test][:, None] - 2 * across
    scale = max(float(near.mean()) / 2, np.finfo(float).tiny)
    return np.exp(-near.clip(0) / scale), np.exp(-far.clip(0) / scale)


View = Callable[[FrameBank, str, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
VIEWS: dict[str, View] = {
    "coordinates": _coordinates_once,
    "rbf": rbf_kernel,
}
"""Input of a baseline, by name: of training and test frames."""
