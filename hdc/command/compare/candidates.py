"""What is compared: forms of the library, and four models of grey values by scikit-learn.

They stand in the order in which they are tried, the cheapest first.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hdc import HDCClassifier, HDCRegressor, circular
from hdc.encoders import make_encoder
from hdc.export.plan import exports
from hdc.readouts import make_readout, make_value_readout

FORMS = (
    ("median", "majority"),  # as published
    ("median", "neighbours"),  # the published bits without the published prototypes
    ("levels", "lda"),  # a discriminant weighs the pixels that tell the classes apart
    ("deviation", "lda"),  # keeps how much of a frame is lit, which ranks throw away
    ("reference_levels", "lda"),  # minus what all frames share, such as a gel or a skin
    ("levels", "kernel"),  # classes that no plane separates
)
"""Forms for classes, the published one first."""
VALUE_FORMS = (
    ("median", "ridge"),
    ("levels", "ridge"),
    ("deviation", "ridge"),
    ("reference_levels", "ridge"),
    ("levels", "neighbours"),  # values that are no sum of what single bits say
)
"""Forms for numbers, the one without a choice first."""
PENALTIES = np.logspace(0, 6, 7)
"""Of ridge regression; its own leave-one-out chooses among them."""


@dataclass(frozen=True)
class Candidate:
    """A model that is compared.

    Attributes:
        name: of the row.
        make: an untrained model, which has ``fit`` and ``predict``.
        parts: names of encoder and read-out; None of a model of grey values.
    """

    name: str
    make: Callable[[], Any]
    parts: tuple[str, str] | None = None

    @property
    def exports(self) -> bool:
        """Whether ``hdc export`` writes it as a header."""
        if self.parts is None:
            return False
        encoder, readout = self.parts
        return exports(make_encoder(encoder), make_readout(readout))


def forms(
    encoders: Sequence[str],
    readouts: Sequence[str],
    learns_values: bool,
    period: float | None = None,
) -> list[Candidate]:
    """The form without a choice, then those of a short list.

    Each of the `encoders` with each of the `readouts` instead, where some are named; those of the
    short list stand for the ones that are not.

    Raises:
        ValueError, TypeError: for a name that is none of them.
    """
    make = make_value_readout if learns_values else make_readout
    for encoder in encoders:
        make_encoder(encoder).check()
    for readout in readouts:
        make(readout).check()
    listed = VALUE_FORMS if learns_values else FORMS
    pairs = list(listed)
    if encoders or readouts:
        every_encoder, every_readout = zip(*listed, strict=True)
        chosen = itertools.product(encoders or every_encoder, readouts or every_readout)
        pairs = [listed[0], *chosen]
    return [_form(*pair, learns_values, period) for pair in dict.fromkeys(pairs)]


def _form(
    encoder: str, readout: str, learns_values: bool, period: float | None
) -> Candidate:
    def make() -> Any:
        if learns_values:
            return HDCRegressor(encoder, readout, period=period)
        return HDCClassifier(encoder, readout)

    return Candidate(f"{encoder}, {readout}", make, (encoder, readout))


# Grey values -------------------------------------------------------------------------------------


def baselines(learns_values: bool, period: float | None = None) -> list[Candidate]:
    """Models of grey values, each pixel standardised over the training frames."""
    from sklearn.linear_model import RidgeClassifierCV, RidgeCV
    from sklearn.multioutput import MultiOutputRegressor
    from sklearn.neighbors import (
        KNeighborsClassifier,
        KNeighborsRegressor,
        NearestCentroid,
    )
    from sklearn.svm import SVC, SVR

    models = {
        "mean image": NearestCentroid(),
        "1-NN": KNeighborsClassifier(1),
        "ridge": RidgeClassifierCV(PENALTIES),
        "SVM": SVC(C=10),
    }
    if learns_values:
        models = {
            "1-NN": KNeighborsRegressor(1),
            "3-NN": KNeighborsRegressor(3),
            "ridge": RidgeCV(PENALTIES),
            "SVM": MultiOutputRegressor(SVR(C=10, epsilon=0.01)),
        }
    found = []
    for name, model in models.items():
        found.append(_of_greys(f"{name} of greys", model, learns_values, period))
    return found


def _of_greys(
    name: str, model: Any, learns_values: bool, period: float | None
) -> Candidate:
    """A model of scikit-learn behind the steps from frames and to values."""
    from sklearn.base import clone
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer, StandardScaler

    def make() -> Any:
        own = make_pipeline(FunctionTransformer(_flat), StandardScaler(), clone(model))
        if not learns_values:
            return own
        own = TransformedTargetRegressor(own, transformer=StandardScaler())
        return own if period is None else Turning(own, period)

    return Candidate(name, make)


def _flat(frames: np.ndarray) -> np.ndarray:
    return frames.reshape(len(frames), -1).astype(np.float32)


class Turning:
    """A model of values that go round, learnt by cosine and sine."""

    def __init__(self, model: Any, period: float) -> None:
        self._model, self._period = model, period

    def fit(self, frames: np.ndarray, values: np.ndarray) -> Turning:
        self._is_signed = bool((values < 0).any())
        self._model.fit(frames, circular.to_plane(values, self._period))
        return self

    def predict(self, frames: np.ndarray) -> np.ndarray:
        plane = self._model.predict(frames)
        return circular.from_plane(plane, self._period, self._is_signed)


def cheapest_first(
    encoders: Sequence[str],
    readouts: Sequence[str],
    learns_values: bool,
    period: float | None,
) -> list[Candidate]:
    """The form without a choice, the baselines, the other forms, and last support vectors."""
    first, *others = forms(encoders, readouts, learns_values, period)
    *cheap, machine = baselines(learns_values, period)
    return [first, *cheap, *others, machine]
