"""Probabilities: held-out scores by definition, calibration, and what has none."""

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.hypervectors import Hypervectors
from hdc.probability import cross_validated, sharpness
from hdc.readouts import (
    LDA,
    Counts,
    Majority,
    Neighbours,
    discriminant,
)
from hdc.readouts.base import HeldOut
from hdc.readouts.counts import cosines
from tests.hdc.net.frames import frames_of
from tests.hdc.own import Nearest, fitted

D, L = 300, 3
CLOSED = [
    Majority(),
    Majority(ties="one"),
    Counts(),
    Neighbours(),
    Neighbours(3),
]


def drawn(sizes, seed=0, flips=0.4):
    """Hypervectors int64 [N, W] around one of each class, in random order, and their classes."""
    rng = np.random.default_rng(seed)
    rows = rng.permutation(np.repeat(np.arange(len(sizes)), sizes))
    centres = rng.random((len(sizes), D)) < 0.5
    flipped = rng.random((len(rows), D)) < flips
    words = bits.pack(torch.from_numpy(centres[rows] ^ flipped))
    return words, torch.from_numpy(rows)


def without_each(readout, words, rows):
    """Scores of each frame by a read-out that is trained on all others."""
    found = []
    for i in range(len(rows)):
        others = torch.arange(len(rows)) != i
        trained = fitted(readout.unlearned(), words[others], rows[others], L, D)
        found.append(trained.scores(words[i : i + 1])[0].double())
    return torch.stack(found)


@pytest.mark.parametrize("readout", CLOSED, ids=repr)
@pytest.mark.parametrize("sizes", [[7, 7, 7], [2, 5, 9]], ids=str)
def test_held_out_scores_are_those_without_the_frame(readout, sizes):
    words, rows = drawn(sizes)
    trained = fitted(readout.unlearned(), words, rows, L, D)
    scores, of = trained.held_out(words, rows)
    torch.testing.assert_close(scores, without_each(readout, words, rows))
    assert torch.equal(of, rows)


def test_a_frame_is_held_out_of_balanced_counts_of_a_larger_class():
    """The class without it is compared as a random subset of the size of the smallest."""
    words, rows = drawn([4, 4, 12])
    trained = fitted(Counts(class_weight="balanced"), words, rows, L, D)
    found = trained.held_out(words, rows).scores
    for i in range(len(rows)):
        others = torch.arange(len(rows)) != i
        without = fitted(Counts(), words[others], rows[others], L, D)
        expected = cosines(without.counters(), words[i : i + 1], 4)[0, rows[i]]
        torch.testing.assert_close(found[i, rows[i]], expected / D**0.5)


def test_lda_scores_some_of_many_frames(monkeypatch):
    words, rows = drawn([10, 10, 10])
    all_of_them = fitted(LDA(0.5), words, rows, L, D).held_out(words, rows)
    monkeypatch.setattr(discriminant, "MOST", 7)
    monkeypatch.setattr(discriminant, "OF_CLASS", 3)
    some = fitted(LDA(0.5), words, rows, L, D).held_out(words, rows)
    places = discriminant.spread_over(rows)
    # 0, 5, 10, 14, 19, 24 and 29 are spread over all; two of the first class are too few.
    assert set(places.tolist()) >= {0, 5, 10, 14, 19, 24, 29}
    assert (torch.bincount(rows[places]) >= 3).all()
    torch.testing.assert_close(some.scores, all_of_them.scores[places])
    assert torch.equal(some.rows, rows[places])


def test_each_fold_is_scored_by_what_the_four_others_teach():
    """The k-th frame of a class is in fold k mod 5; the only one of a class is in none."""
    words, rows = drawn([8, 1, 3])
    fold = torch.tensor([int((rows[:i] == c).sum()) % 5 for i, c in enumerate(rows)])
    expected, classes = [], []
    for i in range(12):
        if rows[i] != 1:
            others = (fold != fold[i]) | (rows == 1)
            trained = fitted(Nearest(), words[others], rows[others], L, D)
            expected.append(trained.scores(words[i : i + 1])[0])
            classes.append(int(rows[i]))
    found = cross_validated(Nearest(), Hypervectors(words, D), rows, L)
    torch.testing.assert_close(found.scores, torch.stack(expected))
    assert found.rows.tolist() == classes


def test_all_wrong_is_no_guess_upside_down():
    rows = torch.arange(20) % 2
    right = torch.nn.functional.one_hot(rows, 2).double()
    found = sharpness(HeldOut(1 - right, rows))
    wrong = torch.softmax(found * (1 - right), dim=1)
    assert found > 0
    assert wrong.max() < 0.5001


def test_scores_that_tell_no_class_from_another_have_the_sharpness_one():
    """Equal within each frame, or of one class; whatever they are from frame to frame."""
    rows = torch.arange(20) % 2
    level = torch.arange(20.0).double()[:, None]
    assert sharpness(HeldOut(level.expand(20, 2), rows)) == 1.0
    assert sharpness(HeldOut(level, torch.zeros(20, dtype=torch.int64))) == 1.0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e12])
@pytest.mark.parametrize(("right", "wrong"), [(20, 0), (17, 3), (600, 300)])
def test_the_sharpness_of_two_classes_is_a_logarithm_of_odds(right, wrong, unit):
    """By hand: the better class is aimed at by (m + 1)/(m + 2) where it is right, by the rest
    where it is wrong, and its probability is 1/(1 + exp(−β·unit))."""
    m = right + wrong
    rows = torch.arange(m) % 2
    better = torch.where(torch.arange(m) < right, rows, 1 - rows)
    scores = unit * torch.nn.functional.one_hot(better, 2).double()
    aim = (right * (m + 1) + wrong) / (m * (m + 2))
    found = sharpness(HeldOut(scores, rows))
    assert found * unit == pytest.approx(np.log(aim / (1 - aim)), rel=1e-9)


def test_recalibrated_counts_say_fit_anew():
    frames, labels = frames_of("uint8", 40)
    model = HDCClassifier(readout="counts").fit(frames, labels)
    model.recalibrate(frames, labels, method="merge")
    with pytest.raises(ValueError, match=r"recalibrated, .*Counts\(.* fit anew"):
        model.predict_proba(frames)


def test_a_class_of_one_frame_is_asked_about_and_one_of_none_has_no_share():
    frames, labels = frames_of("uint8", 41)
    labels = np.where(np.arange(41) == 40, 7, labels)
    model = HDCClassifier().fit(frames, labels)
    scores, rows = model._head.held_out
    kept = rows != 3  # its own frame is not scored without itself
    expected = sharpness(HeldOut(scores[kept], rows[kept]))
    assert model._head.sharpness == expected
    model = HDCClassifier().partial_fit(frames[:40], labels[:40], classes=range(6))
    assert (model.predict_proba(frames)[:, 3:] == 0).all()
    single = HDCClassifier().fit(frames[:3], labels[:3])
    message = "predict_proba: expected two training frames or more of a class"
    with pytest.raises(ValueError, match=message):
        single.predict_proba(frames)
