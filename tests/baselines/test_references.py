"""The other competitors against a direct computation."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from baselines.correlation import CorrelationClassifier
from baselines.features import Thumbnail
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier
from tests.baselines.scaled import scaled


@pytest.mark.parametrize("pixels", ["unit", "standardised"])
def test_ridge_is_that_of_scikit_learn(pixels, speckle):
    frames, labels = speckle(30, (9, 8), 3)
    x = scaled(frames, pixels)
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels).decision_function(x)
    ours = RidgeReadout(alpha=0.3, pixels=pixels)
    scores = ours.fit(frames, labels).scores(frames)
    np.testing.assert_allclose(scores, theirs, rtol=1e-4, atol=1e-4)
    with pytest.raises(ValueError, match="alpha: expected a number above zero, found"):
        RidgeReadout(alpha=0.0).fit(frames, labels)


def test_correlation_is_the_textbook_coefficient(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    model, x = CorrelationClassifier().fit(frames, labels), scaled(frames)
    templates = np.stack([x[labels == c].mean(axis=0) for c in range(3)])
    expected = np.corrcoef(x, templates)[: len(x), len(x) :]
    np.testing.assert_allclose(model.scores(frames), expected, atol=1e-6)


def test_an_estimator_is_left_unfitted_and_only_a_linear_one_has_a_known_size(speckle):
    given, estimator = speckle(30, (9, 8), 3), LogisticRegression()
    model = SklearnClassifier(estimator=estimator).fit(*given)
    assert not hasattr(estimator, "coef_")
    assert model.state_tensors().keys() == {"coef_", "intercept_"}
    tree = SklearnClassifier(estimator=DecisionTreeClassifier()).fit(*given)
    assert tree.state_tensors() is None


@pytest.mark.parametrize("classes", [2, 3])
def test_thumbnails_are_told_apart_by_logistic_regression(classes, speckle):
    frames, labels = speckle(60, (12, 24), classes)
    x = frames.view(60, 6, 2, 8, 3).double().mean(dim=(2, 4)).flatten(1).numpy()
    model = Thumbnail().fit(frames, labels)
    np.testing.assert_allclose(model.features(frames), x, atol=1e-3)
    theirs = make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000))
    logits = theirs.fit(x, labels).decision_function(x)
    scores = model.scores(frames)
    found = scores[:, 1] if classes == 2 else scores
    np.testing.assert_allclose(found, logits, atol=1e-2)
    assert scores.shape == (60, classes)
