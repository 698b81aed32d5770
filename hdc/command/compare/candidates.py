"""The models that are compared: forms of the library, and four models of grey values of
scikit-learn.

They stand in the order in which they are tried, the cheapest first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hdc import HDCClassifier, HDCRegressor
from hdc.export import plan

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


def is_form(model: Any) -> bool:
    """Whether a model is a form of the library, and no model of grey values."""
    return isinstance(model, HDCClassifier | HDCRegressor)


def exports(model: Any) -> bool:
    """Whether ``hdc export`` writes a model as a header."""
    return is_form(model) and plan.exports(
        model.fresh("encoder"), model.fresh("readout")
    )


def forms(learns_values: bool) -> dict[str, Any]:
    """Untrained models by name: the form without a choice, then the others of the short list."""
    kind = HDCRegressor if learns_values else HDCClassifier
    listed = VALUE_FORMS if learns_values else FORMS
    return {", ".join(parts): kind(*parts) for parts in listed}


def baselines(learns_values: bool) -> dict[str, Any]:
    """Models of grey values by name, each pixel standardised over the training frames."""
    from sklearn.compose import TransformedTargetRegressor
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
    found = {}
    for name, model in models.items():
        whole = make_pipeline(FunctionTransformer(_flat), StandardScaler(), model)
        if learns_values:
            whole = TransformedTargetRegressor(whole, transformer=StandardScaler())
        found[f"{name} of grey values"] = whole
    return found


def _flat(frames: np.ndarray) -> np.ndarray:
    return frames.reshape(len(frames), -1).astype(np.float32)


def cheapest_first(learns_values: bool) -> dict[str, Any]:
    """The form without a choice, the baselines, the other forms, and last support vectors."""
    first, *others = forms(learns_values).items()
    *cheap, machine = baselines(learns_values).items()
    return dict([first, *cheap, *others, machine])
