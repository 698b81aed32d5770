"""The models that are compared: forms of the library, and four models of grey values of
scikit-learn.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import hdc

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


def cheapest_first(learns_values: bool) -> dict[str, Any]:
    """Untrained models by name: the form without a choice, the baselines, the other forms, and last
    support vectors."""
    kind: type = hdc.HDCRegressor if learns_values else hdc.HDCClassifier
    listed = VALUE_FORMS if learns_values else FORMS
    first, *others = ((", ".join(parts), kind(*parts)) for parts in listed)
    *cheap, machine = baselines(learns_values).items()
    return dict([first, *cheap, *others, machine])


def baselines(learns_values: bool) -> dict[str, Any]:
    """Models of grey values by name, each pixel standardised over the training frames."""
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer, StandardScaler

    models = _of_values() if learns_values else _of_classes()
    return {
        f"{name} of grey values": make_pipeline(
            FunctionTransformer(np.float32), StandardScaler(), model
        )
        for name, model in models.items()
    }


def _of_classes() -> dict[str, Any]:
    from sklearn.linear_model import RidgeClassifierCV
    from sklearn.neighbors import KNeighborsClassifier, NearestCentroid
    from sklearn.svm import SVC

    return {
        "mean image": NearestCentroid(),
        "1-NN": KNeighborsClassifier(1),
        "ridge": RidgeClassifierCV(PENALTIES),
        "SVM": SVC(C=10),
    }


def _of_values() -> dict[str, Any]:
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.linear_model import RidgeCV
    from sklearn.multioutput import MultiOutputRegressor
    from sklearn.neighbors import KNeighborsRegressor
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVR

    machine = MultiOutputRegressor(SVR(C=10, epsilon=0.01))
    return {
        "ridge": RidgeCV(PENALTIES),
        "1-NN": KNeighborsRegressor(1),
        "3-NN": KNeighborsRegressor(3),
        "SVM": TransformedTargetRegressor(machine, transformer=StandardScaler()),
    }
