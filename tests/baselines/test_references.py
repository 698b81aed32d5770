"""The other competitors against a direct computation."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sklearn.base import BaseEstimator
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import LabelEncoder, StandardScaler
from sklearn.tree import DecisionTreeClassifier

from baselines import record_hdc
from baselines.correlation import CorrelationClassifier
from baselines.integer import unpack
from baselines.nearest_neighbour import NearestNeighbour, binarise
from baselines.record_hdc import RecordHDC
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier


@pytest.mark.parametrize("pixels", ["unit", "standard"])
def test_ridge_has_the_decision_values_of_scikit_learn(pixels, speckle):
    frames, labels = speckle(30, (9, 8), 3)
    ours = RidgeReadout(alpha=0.3, pixels=pixels).fit(frames, labels)
    x = frames.flatten(1).double().numpy()
    x = x / 255 if pixels == "unit" else StandardScaler().fit_transform(x)
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels)
    scores = ours.scores(frames)
    np.testing.assert_allclose(scores, theirs.decision_function(x), rtol=1e-4, atol=1e-4)
    with pytest.raises(ValueError, match="alpha: expected a number above zero, found 0"):
        RidgeReadout(alpha=0.0).fit(frames, labels)


def test_correlation_is_the_textbook_coefficient(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    model = CorrelationClassifier().fit(frames, labels)
    x = frames.flatten(1).double().numpy()
    templates = np.stack([x[labels == c].mean(axis=0) for c in range(3)])
    expected = np.corrcoef(x, templates)[: len(x), len(x) :]
    np.testing.assert_allclose(model.scores(frames), expected, atol=1e-6)


def test_correlation_is_blind_to_exposure_and_offset(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    dark = (frames // 4).clamp(max=50)
    model = CorrelationClassifier().fit(dark, labels)
    np.testing.assert_allclose(model.scores(dark), model.scores(dark * 4 + 30), atol=1e-6)


def test_a_frame_without_contrast_correlates_with_nothing(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    model = CorrelationClassifier().fit(frames, labels)
    assert (model.scores(torch.full((1, 9, 8), 200, dtype=torch.uint8)) == 0).all()


def test_a_class_not_seen_yet_is_never_the_best(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    order = np.argsort(labels)
    model = CorrelationClassifier(batch_size=10)
    next(iter(model.train(frames[torch.from_numpy(order)], labels[order])))
    assert set(model.predict(frames)) == {0}


@pytest.mark.parametrize("shape", [(1, 7), (9, 8), (5, 13)])
def test_nearest_neighbour_distances_are_hamming(shape, speckle):
    frames, labels = speckle(20, shape, 2)
    model = NearestNeighbour(batch_size=6).fit(frames, labels)
    x = frames.flatten(1).numpy()
    # The lower median: the paper's threshold leaves it open for an even number of pixels.
    bits = x > np.sort(x, axis=1)[:, (x.shape[1] - 1) // 2][:, None]
    assert (binarise(frames.flatten(1)).numpy() == bits).all()
    expected = (bits[:, None] != bits[None]).sum(axis=2)
    assert (model.distances(frames).numpy() == expected).all()
    assert (model.predict(frames) == labels[expected.argmin(axis=1)]).all()


def brute_force(model: RecordHDC, frames: np.ndarray) -> np.ndarray:
    """V of the record-based encoding by its definition, ±1 [N, D]."""
    d, n = model.dimension, model.levels
    positions = 2 * unpack(model.positions_).numpy().astype(int) - 1
    base = 2 * unpack(model.base_)[0].numpy().astype(int) - 1
    levels = np.tile(base, (n, 1))
    for v in range(1, n):
        levels[v, : round(v * (d // 2) / (n - 1))] *= -1
    pixels = frames.reshape(len(frames), -1)[:, model.pixels_.numpy()]
    quantised = pixels.astype(int) * n // 256
    sums = np.stack([(positions * levels[image]).sum(axis=0) for image in quantised])
    return np.where(sums == 0, base, np.sign(sums))


@pytest.mark.parametrize(
    ("dimension", "levels", "n_pixels"), [(16, 2, None), (64, 16, 31), (256, 5, None), (48, 256, 7)]
)
def test_record_encoding_is_its_definition(dimension, levels, n_pixels, monkeypatch, speckle):
    monkeypatch.setattr(record_hdc, "POSITIONS", 20)
    frames, labels = speckle(12, (9, 8), 3)
    frames[0], frames[1] = 0, 255
    model = RecordHDC(dimension=dimension, levels=levels, n_pixels=n_pixels, seed=4)
    model.fit(frames, labels)
    expected = brute_force(model, frames.numpy())
    assert (model.encode(frames).numpy() == expected).all()

    base = unpack(model.base_)[0].numpy()
    for c, prototype in enumerate(unpack(model.prototypes_).numpy()):
        count = expected[labels == c].sum(axis=0)
        assert (prototype == np.where(count == 0, base, count > 0)).all()
    assert model.codebook_bytes_ == (len(model.pixels_) + levels) * dimension // 8


def test_level_hypervectors_are_orthogonal_end_to_end(speckle):
    """Frames of the darkest and the brightest level alone are bound to L_0 and L_{n−1}."""
    frames, labels = speckle(12, (9, 8), 3)
    model = RecordHDC(dimension=4096).fit(frames, labels)
    flat = torch.stack([torch.zeros(9, 8), torch.full((9, 8), 255)]).to(torch.uint8)
    dark, bright = model.encode(flat)
    ties = 0.1  # about 1/√(π·36) of the sums are zero and do not flip
    assert abs(float(dark @ bright)) / 4096 < ties


def test_a_codebook_made_again_is_the_codebook_stored(speckle):
    frames, labels = speckle(12, (9, 8), 3)
    stored = RecordHDC(dimension=64).fit(frames, labels)
    drawn = RecordHDC(dimension=64, store_codebook=False).fit(frames, labels)
    assert torch.equal(stored.encode(frames), drawn.encode(frames))
    assert "positions" in stored.state_tensors()
    assert "positions" not in drawn.state_tensors()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"dimension": 100}, "dimension: expected a multiple of 16, found 100"),
        ({"levels": 1}, "levels: expected 2 to 256, found 1"),
        ({"n_pixels": 73}, "n_pixels: expected 1 to 72, found 73"),
    ],
)
def test_record_hdc_names_what_is_wrong(given, message, speckle):
    with pytest.raises(ValueError, match=message):
        RecordHDC(**given).fit(*speckle(12, (9, 8), 3))


def test_any_estimator_is_left_unfitted_and_its_state_found(speckle):
    frames, labels = speckle(30, (9, 8), 3)
    estimator = make_pipeline(StandardScaler(), LogisticRegression())
    model = SklearnClassifier(estimator=estimator).fit(frames, labels)
    assert not hasattr(estimator[-1], "coef_")
    names = model.state_tensors().keys()
    assert any(name.endswith("coef_") for name in names)
    assert any(name.endswith("scale_") for name in names)


class Boosted(BaseEstimator):
    """What it learnt is in an object of a compiled library; its labels alone are an array."""

    def fit(self, x, y):
        self._encoder = LabelEncoder().fit(y)
        self._counts = np.bincount(y)
        self._owner, self._library = self, object()
        return self

    def predict(self, x):
        return np.zeros(len(x), dtype=int)


@pytest.mark.parametrize(
    "estimator",
    [DecisionTreeClassifier(), RandomForestClassifier(2), Boosted()],
    ids=lambda estimator: type(estimator).__name__,
)
def test_what_is_not_all_in_arrays_has_no_known_size(estimator, speckle):
    model = SklearnClassifier(estimator=estimator).fit(*speckle(30, (9, 8), 3))
    assert model.state_tensors() is None


def test_the_seed_reaches_the_estimator(speckle):
    model = SklearnClassifier(estimator=DecisionTreeClassifier(), seed=9)
    assert model.fit(*speckle(30, (9, 8), 3)).estimator_.random_state == 9
