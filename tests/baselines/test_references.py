"""The other competitors against a direct computation."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from baselines import record_hdc
from baselines.correlation import CorrelationClassifier
from baselines.hdc_online import OnlineHDCClassifier
from baselines.linear_bits import BitReadout
from baselines.pixels import signs
from baselines.record_hdc import RecordHDC, unpack
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier
from hdc import bits
from hdc.encode import encode


@pytest.mark.parametrize("pixels", ["unit", "standardised"])
def test_ridge_has_the_decision_values_of_scikit_learn(pixels, speckle):
    frames, labels = speckle(30, (9, 8), 3)
    ours = RidgeReadout(alpha=0.3, pixels=pixels).fit(frames, labels)
    x = frames.flatten(1).double().numpy()
    x = x / 255 if pixels == "unit" else StandardScaler().fit_transform(x.T).T
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels)
    scores = ours.scores(frames)
    np.testing.assert_allclose(scores, theirs.decision_function(x), rtol=1e-4, atol=1e-4)
    with pytest.raises(ValueError, match="alpha: expected a number above zero, found 0"):
        RidgeReadout(alpha=0.0).fit(frames, labels)


def test_ridge_on_bits_has_the_weights_of_scikit_learn(speckle):
    frames, labels = speckle(30, (9, 7), 3)
    x = signs(frames).flatten(1).float().numpy()
    ours = BitReadout(alpha=0.3).fit(frames, labels)
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels)
    np.testing.assert_allclose(ours.weight_, theirs.coef_, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(
        ours.scores(frames), theirs.decision_function(x), rtol=1e-4, atol=1e-4
    )


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


def test_a_class_not_seen_yet_is_never_the_best(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    order = np.argsort(labels)
    model = CorrelationClassifier(batch_size=10)
    next(iter(model.train(frames[torch.from_numpy(order)], labels[order])))
    assert set(model.predict(frames)) == {0}


def brute_force(model: RecordHDC, frames: np.ndarray) -> np.ndarray:
    """V of the record-based encoding by its definition, ±1 [N, D]."""
    d, n = model.dimension, model.levels
    positions = 2 * unpack(model.positions_).numpy().astype(int) - 1
    base = 2 * unpack(model.base_)[0].numpy().astype(int) - 1
    levels = np.tile(base, (n, 1))
    for v in range(1, n):
        levels[v, : round(v * (d // 2) / (n - 1))] *= -1
    pixels = frames.reshape(len(frames), -1)
    quantised = pixels.astype(int) * n // 256
    sums = np.stack([(positions * levels[image]).sum(axis=0) for image in quantised])
    return np.where(sums == 0, base, np.sign(sums))


@pytest.mark.parametrize(("dimension", "levels"), [(16, 2), (64, 16), (256, 5), (48, 256)])
def test_record_encoding_is_its_definition(dimension, levels, monkeypatch, speckle):
    monkeypatch.setattr(record_hdc, "POSITIONS", 20)
    frames, labels = speckle(12, (9, 8), 3)
    frames[0], frames[1] = 0, 255
    model = RecordHDC(dimension=dimension, levels=levels, seed=4)
    model.fit(frames, labels)
    expected = brute_force(model, frames.numpy())
    assert (model.encode(frames).numpy() == expected).all()

    base = unpack(model.base_)[0].numpy()
    for c, prototype in enumerate(unpack(model.prototypes_).numpy()):
        count = expected[labels == c].sum(axis=0)
        assert (prototype == np.where(count == 0, base, count > 0)).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"dimension": 100}, "dimension: expected a multiple of 16, found 100"),
        ({"levels": 1}, "levels: expected 2 to 256, found 1"),
    ],
)
def test_record_hdc_names_what_is_wrong(given, message, speckle):
    with pytest.raises(ValueError, match=message):
        RecordHDC(**given).fit(*speckle(12, (9, 8), 3))


def test_an_estimator_is_left_unfitted_and_only_a_linear_one_has_a_known_size(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    estimator = LogisticRegression()
    model = SklearnClassifier(estimator=estimator).fit(frames, labels)
    assert not hasattr(estimator, "coef_")
    assert model.state_tensors().keys() == {"coef_", "intercept_"}
    for other in (make_pipeline(StandardScaler(), estimator), DecisionTreeClassifier()):
        assert SklearnClassifier(estimator=other).fit(frames, labels).state_tensors() is None
    with pytest.raises(ValueError, match="estimator: expected an object with fit and predict"):
        SklearnClassifier(estimator="LinearSVC").fit(frames, labels)


def confusable(n=60, classes=4, seed=1):
    """Frames so noisy that some are taken for another class, and their labels."""
    rng = np.random.default_rng(seed)
    labels = rng.permutation(np.arange(n) % classes)
    base = rng.integers(0, 150, (classes, 9, 15))
    frames = base[labels] + rng.integers(0, 300, (n, 9, 15))
    return torch.from_numpy((frames // 2).astype(np.uint8)), labels


def online_in_floats(frames, labels, bundle, correction):
    """The update rule in ±1 as AdaptHD has it: prototypes bool [L, D], number of mistakes."""
    n_classes, dimension = labels.max() + 1, frames[0].numel()
    samples = 2.0 * bits.unpack(encode(frames), dimension).numpy() - 1
    sums, seen, mistakes = np.zeros((n_classes, dimension)), np.zeros(n_classes, bool), 0
    for sample, label in zip(samples, labels, strict=True):
        if not seen[label]:
            sums[label] += max(1, bundle) * sample
            seen[label] = True
            continue
        scores = np.where(sums > 0, 1, -1) @ sample
        taken = int(np.where(seen, scores, -np.inf).argmax())
        sums[label] += bundle * sample
        if taken != label:
            mistakes += 1
            sums[label] += correction * sample
            sums[taken] -= correction * sample
    return sums > 0, mistakes


@pytest.mark.parametrize("weights", [(2, 1), (1, 1), (0, 1), (1, 3), (4, 1)])
def test_online_prototypes_are_those_of_the_rule_in_floats(weights):
    frames, labels = confusable()
    expected, mistakes = online_in_floats(frames, labels, *weights)
    assert 4 < mistakes < 55
    for batch_size in (7, 256):
        model = OnlineHDCClassifier(
            bundle=weights[0], correction=weights[1], batch_size=batch_size
        ).fit(frames, labels)
        assert (bits.unpack(model.prototypes_, frames[0].numel()).numpy() == expected).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"bundle": -1}, "bundle: expected an integer from 0, found -1"),
        ({"bundle": 0, "correction": 0}, "expected one above 0"),
        ({"ties": "heads"}, "ties: expected one of zero, one, found 'heads'"),
    ],
)
def test_weights_of_online_hdc_are_checked(given, message):
    with pytest.raises(ValueError, match=message):
        OnlineHDCClassifier(**given).fit(*confusable())
