"""The models that are compared: forms of the library, and four models of grey values of
scikit-learn.

They stand in the order in which they are tried, the cheapest first.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hdc import HDCClassifier, HDCRegressor, circular
from hdc.export.plan import exports

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
"""Penalties of ridge regression; its own leave-one-out chooses among them."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model that is compared.

    Attributes:
        name: of the row.
        model: untrained; copies of it learn.
    """

    name: str
    model: Any

    @property
    def is_form(self) -> bool:
        """Whether it is a form of the library, and no model of grey values."""
        return isinstance(self.model, HDCClassifier | HDCRegressor)

    @property
    def exports(self) -> bool:
        """Whether ``hdc export`` writes it as a header."""
        return self.is_form and exports(
            self.model.fresh("encoder"), self.model.fresh("readout")
        )


def forms(
    encoders: Sequence[str],
    readouts: Sequence[str],
    learns_values: bool,
    period: float | None = None,
) -> list[Candidate]:
    """The form without a choice, then the forms of a short list.

    Where encoders or read-outs are named, each named encoder with each named read-out instead; if
    only one of the two is named, the short list gives the other.

    Raises:
        ValueError, TypeError: for a name that is none of them.
    """
    listed = VALUE_FORMS if learns_values else FORMS
    pairs = list(listed)
    if encoders or readouts:
        every_encoder, every_readout = zip(*listed, strict=True)
        chosen = itertools.product(encoders or every_encoder, readouts or every_readout)
        pairs = [listed[0], *chosen]
    found = []
    for parts in dict.fromkeys(pairs):
        model: Any = HDCClassifier(*parts)
        if learns_values:
            model = HDCRegressor(*parts, period=period)
        for part in model.parts:
            model.fresh(part)
        found.append(Candidate(", ".join(parts), model))
    return found


def baselines(learns_values: bool, period: float | None) -> list[Candidate]:
    """Models of grey values, each pixel standardised over the training frames."""
    from sklearn.linear_model import RidgeClassifierCV, RidgeCV
    from sklearn.multioutput import MultiOutputRegressor
    from sklearn.neighbors import (
        KNeighborsClassifier,
        KNeighborsRegressor,
        NearestCentroid,
    )
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer, StandardScaler
    from sklearn.svm import SVC, SVR

    models = {
        "mean image": NearestCentroid(),
        "1-NN": KNeighborsClassifier(1),
        "ridge": RidgeClassifierCV(PENALTIES),
        "SVM": SVC(C=10),
    }
    if learns_values:
        models = {
            "ridge": RidgeCV(PENALTIES),
            "1-NN": KNeighborsRegressor(1),
            "3-NN": KNeighborsRegressor(3),
            "SVM": MultiOutputRegressor(SVR(C=10, epsilon=0.01)),
        }
    found = []
    for name, model in models.items():
        whole = make_pipeline(FunctionTransformer(_flat), StandardScaler(), model)
        if learns_values:
            whole = _standardised(whole, period)
        found.append(Candidate(f"{name} of grey values", whole))
    return found


def _flat(frames: np.ndarray) -> np.ndarray:
    return frames.reshape(len(frames), -1).astype(np.float32)


def _standardised(model: Any, period: float | None) -> Any:
    """A model that learns standardised values; with a period, their cosine and sine."""
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer, StandardScaler

    steps = [StandardScaler()]
    if period is not None:
        on_circle = FunctionTransformer(
            circular.to_plane,
            circular.from_plane,
            kw_args={"period": period},
            inv_kw_args={"period": period},
        )
        steps = [on_circle, *steps]
    # The check of the inverse compares angles as numbers, and so a whole turn apart.
    return TransformedTargetRegressor(
        model, transformer=make_pipeline(*steps), check_inverse=False
    )


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
