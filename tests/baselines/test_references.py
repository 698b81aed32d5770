"""The other competitors against a direct computation."""

import numpy as np
import pytest
import torch
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from baselines.correlation import CorrelationClassifier
from baselines.features import Brightness, Thumbnail
from baselines.linear_bits import BitReadout
from baselines.pixels import signs
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier


@pytest.mark.parametrize("pixels", ["unit", "standardised", "bits"])
def test_ridge_is_that_of_scikit_learn(pixels, speckle):
    frames, labels = speckle(30, (9, 8), 3)
    x = frames.flatten(1).double().numpy()
    if pixels == "bits":
        ours, x = BitReadout(alpha=0.3), signs(frames).flatten(1).float().numpy()
    else:
        ours = RidgeReadout(alpha=0.3, pixels=pixels)
        x = x / 255 if pixels == "unit" else StandardScaler().fit_transform(x.T).T
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels).decision_function(x)
    scores = ours.fit(frames, labels).scores(frames)
    np.testing.assert_allclose(scores, theirs, rtol=1e-4, atol=1e-4)
    with pytest.raises(ValueError, match="alpha: expected a number above zero, found"):
        RidgeReadout(alpha=0.0).fit(frames, labels)


def test_one_bit_a_weight_is_the_nearest_such_read_out(speckle):
    frames, labels = speckle(40, (9, 7), 4)
    whole = BitReadout().fit(frames, labels)
    one_bit = BitReadout(one_bit=True).fit(frames, labels)
    x = signs(frames).flatten(1).float().numpy()
    w = whole.weight_.numpy()
    nearest = np.abs(w).mean(1, keepdims=True) * np.sign(w)
    y = 2.0 * (labels[:, None] == np.arange(4)) - 1
    expected = (x - x.mean(0)) @ nearest.T + y.mean(0)
    np.testing.assert_allclose(one_bit.scores(frames), expected, rtol=1e-4, atol=1e-4)
    assert one_bit.score(frames, labels) > 0.9


def test_correlation_is_the_textbook_coefficient(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    model = CorrelationClassifier().fit(frames, labels)
    x = frames.flatten(1).double().numpy()
    templates = np.stack([x[labels == c].mean(axis=0) for c in range(3)])
    expected = np.corrcoef(x, templates)[: len(x), len(x) :]
    np.testing.assert_allclose(model.scores(frames), expected, atol=1e-6)


def test_an_estimator_is_left_unfitted_and_only_a_linear_one_has_a_known_size(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    estimator = LogisticRegression()
    model = SklearnClassifier(estimator=estimator).fit(frames, labels)
    assert not hasattr(estimator, "coef_")
    assert model.state_tensors().keys() == {"coef_", "intercept_"}
    for other in (make_pipeline(StandardScaler(), estimator), DecisionTreeClassifier()):
        assert (
            SklearnClassifier(estimator=other).fit(frames, labels).state_tensors()
            is None
        )


def test_brightness_is_logistic_regression_of_mean_and_deviation(speckle):
    frames, labels = speckle(60, (9, 8), 3)
    frames = (frames // 2 + 30 * torch.from_numpy(labels)[:, None, None]).byte()
    pixels = frames.flatten(1).numpy().astype(float)
    numbers = np.column_stack([pixels.mean(axis=1), pixels.std(axis=1)])
    theirs = make_pipeline(StandardScaler(), LogisticRegression()).fit(numbers, labels)
    ours = Brightness().fit(frames, labels)
    logits = theirs.decision_function(numbers)
    np.testing.assert_allclose(ours.scores(frames), logits, atol=1e-3)
    assert ours.score(frames, labels) > 0.9
    rearranged = frames.flatten(1)[:, torch.randperm(72)].view(frames.shape)
    assert (ours.predict(rearranged) == ours.predict(frames)).all()


@pytest.mark.parametrize("classes", [2, 3])
def test_a_thumbnail_is_the_means_of_blocks(classes, speckle):
    frames, labels = speckle(60, (12, 24), classes)
    blocks = frames.view(60, 6, 2, 8, 3).float().mean(dim=(2, 4)).flatten(1).numpy()
    theirs = make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000))
    ours = Thumbnail().fit(frames, labels)
    np.testing.assert_allclose(ours.features(frames), blocks, atol=1e-3)
    predicted = theirs.fit(blocks, labels).predict(blocks)
    assert (ours.predict(frames) == predicted).all()
    assert ours.state_tensors()["weight"].shape == (classes, 48)
