"""What a model does not know: leave-one-out distances, their limits, and probabilities."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import optimize, special, stats

from hdc import HDCClassifier, bits, rejection
from hdc.encode import encode
from hdc.online import OnlineHDCClassifier
from hdc.prototypes import Counters
from hdc.rejection import KEPT, Sample

D = 4096


class Speckle:
    """Speckle of correlated classes: |field of the class + a share of a fresh field|².

    The fields have 36 % of their intensity in common. The share of the fresh field differs from
    frame to frame, so that the distances of a class spread far more than independent bits would.
    """

    def __init__(self, seed: int, classes: int = 5):
        self.rng, self.classes = np.random.default_rng(seed), classes
        self.common = self.field(1)
        self.fields = self.of_new_classes()

    def field(self, n: int) -> np.ndarray:
        return self.rng.standard_normal((n, D)) + 1j * self.rng.standard_normal((n, D))

    def of_new_classes(self) -> np.ndarray:
        return 0.6 * self.common + 0.8 * self.field(self.classes)

    def frames(self, n: int, fields: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        labels = np.arange(n) % self.classes
        share = 0.5 * np.exp(0.2 * self.rng.standard_normal((n, 1)))
        fields = self.fields if fields is None else fields
        intensity = np.abs(fields[labels] + share * self.field(n)) ** 2
        return np.clip(30 * intensity, 0, 255).astype(np.uint8), labels


def junk(seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).integers(0, 256, (50, D))
    return np.concatenate([noise, np.zeros((1, D)), np.full((1, D), 255)]).astype(np.uint8)


@pytest.mark.parametrize("prototype", ["binary", "integer"])
@pytest.mark.parametrize("per_class", [10, 40])
@pytest.mark.filterwarnings("ignore:.*constant frame")
def test_the_share_of_known_frames_that_are_refused_is_about_the_stated(
    per_class: int, prototype: str
) -> None:
    shares = []
    for seed in range(6):
        speckle = Speckle(seed)
        model = HDCClassifier(prototype=prototype).fit(*speckle.frames(5 * per_class))
        frames, labels = speckle.frames(1000)
        assert model.score(frames, labels) == 1
        shares.append([1 - model.is_known(frames, rate).mean() for rate in (0.01, 0.05, 0.2)])
        assert not model.is_known(junk()).any()
        unlike, _ = speckle.frames(200, speckle.of_new_classes())
        assert not model.is_known(unlike).any()
    low, middle, high = np.mean(shares, 0)
    assert 0.002 < low < 0.03, shares
    assert 0.025 < middle < 0.09, shares
    assert 0.14 < high < 0.27, shares


@pytest.mark.filterwarnings("ignore:.*constant frame")
def test_predictions_that_are_none() -> None:
    speckle = Speckle(1)
    frames, labels = speckle.frames(100)
    names = np.array(list("edcba"))
    model = HDCClassifier().fit(frames, names[labels])
    new, labels = speckle.frames(200)
    mixed = np.concatenate([new, junk()])
    found = model.predict(mixed, reject=0.001)
    assert found.dtype == object
    assert found[:200].tolist() == names[labels].tolist()
    assert found[200:].tolist() == [None] * 52
    assert model.predict(mixed[:200]).dtype == np.dtype("<U1")
    plain = model.predict(mixed)
    known = model.is_known(mixed)
    expected = [label if k else None for label, k in zip(plain, known, strict=True)]
    assert model.predict(mixed, reject=True).tolist() == expected
    assert model.predict(new[:0], reject=True).shape == (0,)
    for rate in (0, -1, 0.6, 7):
        with pytest.raises(ValueError, match=r"reject: expected a share in \(0, 0.5\], found"):
            model.is_known(mixed, rate)


# Leaving one out ----------------------------------------------------------------------------------


def left_out(words: torch.Tensor, i: int, ties: str, prototypes: Counters) -> int:
    """The distance of hypervector i to the majority of the others, counted anew."""
    others = torch.cat((words[:i], words[i + 1 :]))
    breaker = prototypes._tie_breaker(3, 0)
    return int(bits.hamming(words[i : i + 1], bits.majority(others, ties, breaker)[None]))


@pytest.mark.parametrize("ties", bits.TIES)
@pytest.mark.parametrize("n", [2, 3, 4, 7, 12])
def test_distances_and_their_mean_are_those_of_training_again(n: int, ties: str) -> None:
    rng = np.random.default_rng(n)
    words = bits.pack(torch.from_numpy(rng.random((n, 333)) < rng.random(333)))
    counters = Counters(1, 333)
    counters.add(words, torch.zeros(n, dtype=torch.int64))
    expected = [left_out(words, i, ties, counters) for i in range(n)]
    met = [counters.prototype(0, ties, 3, extra) for extra in (1, -1)]
    assert rejection._distances(words, *met).tolist() == expected
    assert rejection._mean_distance(counters.planes[0], n, *met) == pytest.approx(np.mean(expected))


@pytest.mark.parametrize("prototype", ["binary", "integer"])
def test_held_out_scores_are_those_of_a_model_without_the_frame(prototype: str) -> None:
    frames, labels = Speckle(2).frames(24)
    frames = frames[:, :500]
    model = HDCClassifier(prototype=prototype).fit(frames, labels)
    calibration = model._calibrated()
    scores, own = [], []
    for i in range(24):
        keep = np.arange(24) != i
        without = HDCClassifier(prototype=prototype).fit(frames[keep], labels[keep])
        row = model._scores(frames[i : i + 1]).numpy()[0].astype(float)
        row[labels[i]] = without._scores(frames[i : i + 1]).numpy()[0, labels[i]]
        scores.append(row)
        own.append(labels[i])
    again = rejection.temperature(np.array(scores), np.array(own))
    assert calibration.temperature == pytest.approx(again, rel=1e-6)


def test_two_frames_of_a_class_are_apart_as_counters_tell() -> None:
    words = encode(torch.from_numpy(Speckle(0).frames(9)[0]))
    counters = Counters(1, D)
    counters.add(words, torch.zeros(9, dtype=torch.int64))
    apart = bits.hamming(words, words).sum() / (9 * 8)
    assert rejection._distance_of_two(counters, 0.0) == pytest.approx(float(apart))


def test_a_class_of_one_frame_is_as_far_as_frames_of_others_are_apart() -> None:
    speckle = Speckle(3)
    frames, labels = speckle.frames(100)
    keep = (labels > 0) | (np.arange(100) == 0)
    model = HDCClassifier().fit(frames[keep], labels[keep])
    new, labels = speckle.frames(500)
    assert model.is_known(new[labels == 0]).mean() > 0.9
    assert not model.is_known(junk()[:50]).any()


def test_models_without_anything_to_leave_out_say_so_and_can_be_calibrated() -> None:
    speckle = Speckle(4)
    frames, labels = speckle.frames(100)
    trained = HDCClassifier().fit(frames, labels)
    models = [
        HDCClassifier().fit(frames[:5], labels[:5]),
        HDCClassifier.from_counters(trained.counters_, trained.classes_, trained.frame_shape_),
        OnlineHDCClassifier().fit(frames, labels),
    ]
    new, labels = speckle.frames(1000)
    for model in models:
        for call in (model.is_known, model.predict_proba):
            with pytest.raises(ValueError, match="calibration: expected a model that was trained"):
                call(new)
        model.calibrate(new[:200], labels[:200])
        assert 0.97 < model.is_known(new[200:]).mean() < 1
        assert not model.is_known(junk()[:50]).any()
        with pytest.raises(ValueError, match=r"labels: expected classes among .*found 9"):
            model.calibrate(new[:2], [0, 9])


# The sample ---------------------------------------------------------------------------------------


def test_the_sample_does_not_depend_on_batches() -> None:
    words = torch.arange(1000)[:, None].repeat(1, 2)
    labels = list(range(1000))
    samples = []
    for cuts, expected in (([1000], 0), ([128] * 8, 1000), ([1] * 1000, 0)):
        sample = Sample(expected)
        for start, n in zip(np.cumsum([0, *cuts]), cuts, strict=False):
            sample.add(words[start : start + n], labels[start : start + n])
        samples.append(sample.words().clone())
        assert sample.labels == samples[-1][:, 0].tolist()
    assert torch.equal(samples[0], samples[1])
    assert torch.equal(samples[0], samples[2])
    assert len(set(samples[0][:, 0].tolist())) == KEPT
    # Every tenth of the frames has its share.
    tenths = np.bincount(samples[0][:, 0] // 100, minlength=10)
    assert stats.chisquare(tenths).pvalue > 0.001


def test_merged_samples_have_the_share_of_each() -> None:
    large, small = Sample(), Sample()
    large.add(torch.zeros(3000, 1).long(), ["large"] * 3000)
    small.add(torch.zeros(1000, 1).long(), ["small"] * 1000)
    large.merge(small)
    assert large.seen == 4000
    assert len(large.labels) == KEPT
    assert stats.binomtest(large.labels.count("small"), KEPT, 0.25).pvalue > 0.001


# Numbers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("freedom", [5, 24, 64])
@pytest.mark.parametrize("p", [0.5, 0.9, 0.99, 0.999])
def test_student_against_scipy(p: float, freedom: int) -> None:
    expected = stats.t.ppf(p, freedom)
    assert rejection.student(p, freedom) == pytest.approx(expected, rel=0.2 / freedom, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_temperature_is_the_most_likely(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scores = rng.normal(100, 10, (50, 4))
    own = rng.integers(0, 4, 50)
    scores[np.arange(50), own] -= 8 * seed  # from chance to no mistakes
    targets = np.full((50, 4), 1 / 52 / 3)
    targets[np.arange(50), own] = 51 / 52

    def loss(log_t: float) -> float:
        return -(targets * special.log_softmax(-scores / np.exp(log_t), 1)).sum()

    best = optimize.minimize_scalar(loss, bounds=(-5, 25), method="bounded").fun
    assert loss(np.log(rejection.temperature(scores, own))) <= best + 1e-6


@pytest.mark.parametrize("prototype", ["binary", "integer"])
def test_probabilities_are_as_often_right_as_they_say(prototype: str) -> None:
    """On frames that are mistaken now and then; on average, a little too modest."""
    differences = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        fields, labels = rng.integers(0, 200, (4, 200)), np.arange(3000) % 4
        frames = fields[labels] + rng.normal(0, 300, (3000, 200))
        model = HDCClassifier(prototype=prototype).fit(frames[:400], labels[:400])
        new, labels = frames[400:], labels[400:]
        probabilities = model.predict_proba(new)
        np.testing.assert_allclose(probabilities.sum(1), 1)
        assert (probabilities.argmax(1) == model.predict(new)).all()
        right = model.score(new, labels)
        assert 0.6 < right < 0.9
        differences.append(probabilities.max(1).mean() - right)
    assert -0.06 < np.mean(differences) < 0.02, differences
    assert np.std(differences) < 0.08, differences


def test_decisions_are_shares_of_pixels() -> None:
    frames, labels = Speckle(0).frames(50)
    model = HDCClassifier().fit(frames, labels)
    np.testing.assert_allclose(model.decision_function(frames), -model.distances(frames) / D)
    two = labels < 2
    model.fit(frames[two], labels[two])
    distances = model.distances(frames)
    expected = (distances[:, 0] - distances[:, 1]) / D
    np.testing.assert_allclose(model.decision_function(frames), expected)
    assert ((model.decision_function(frames) > 0) == (model.predict(frames) == 1)).all()
