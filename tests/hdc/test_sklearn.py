"""Tools of scikit-learn around both estimators: what they say is what the estimator alone says."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import StackingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import (
    GridSearchCV,
    KFold,
    learning_curve,
)
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from hdc import HDCClassifier, HDCRegressor

N, SIDE = 60, 12
LABELS = np.arange(N) % 3
DEPTH = np.linspace(0, 1, N)
CLASSIFIERS = [HDCClassifier(), HDCClassifier("levels", "lda")]


@pytest.fixture(scope="module")
def frames():
    """Rows of pixels of three classes, brighter in one half with depth."""
    rng = np.random.default_rng(1)
    base = rng.integers(0, 120, (3, SIDE, SIDE))[LABELS]
    noise = rng.integers(0, 40, (N, SIDE, SIDE))
    pressed = (DEPTH[:, None, None] * 90).astype(int) * (np.arange(SIDE) < SIDE // 2)
    return (base + noise + pressed).astype(np.uint8).reshape(N, -1)


def test_a_grid_reaches_the_parameters_of_the_parts(frames):
    grid = {
        "encoder": ["median", "levels"],
        "readout__ties": ["zero", "random"],
        "encoder__ties": ["spread", "raster"],
    }
    search = GridSearchCV(HDCClassifier(), grid, cv=3).fit(frames, LABELS)
    assert set(search.best_params_) == set(grid)
    assert search.best_score_ > 0.9
    piped = make_pipeline(FunctionTransformer(), HDCRegressor())
    penalties = {"hdcregressor__readout__penalty": [1e-3, 1e3]}
    folds = KFold(3, shuffle=True, random_state=0)
    chosen = GridSearchCV(piped, penalties, cv=folds).fit(frames, DEPTH)
    assert chosen.best_params_ == {"hdcregressor__readout__penalty": 1e-3}
    assert chosen.best_score_ > 0.5
    alone = HDCRegressor().set_params(readout__penalty=1e-3).fit(frames, DEPTH)
    np.testing.assert_array_equal(chosen.predict(frames), alone.predict(frames))


def test_learning_curves_use_partial_fit(frames):
    options = {"cv": 3, "train_sizes": [0.5, 1.0], "exploit_incremental_learning": True}
    _, _, scores = learning_curve(HDCClassifier(), frames, LABELS, **options)
    assert scores[-1].min() > 0.9


@pytest.mark.parametrize("model", CLASSIFIERS, ids=repr)
def test_other_models_are_built_on_scores(model, frames):
    calibrated = CalibratedClassifierCV(model, cv=3).fit(frames, LABELS)
    shares = calibrated.predict_proba(frames)
    assert np.allclose(shares.sum(1), 1)
    assert (shares.argmax(1) == LABELS).mean() > 0.9
    others = [("hdc", model), ("lr", LogisticRegression(max_iter=1000))]
    stacked = StackingClassifier(others, LogisticRegression(), cv=3)
    assert stacked.fit(frames, LABELS).score(frames, LABELS) > 0.9
