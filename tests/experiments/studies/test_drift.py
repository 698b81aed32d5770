"""Recalibration: updates do what they are called, and no test sample was learnt from."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from baselines.linear import PenalisedClassifier
from experiments.protocol.evaluate import bank_of
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.studies.drift import measure
from experiments.studies.drift.measure import (
    Choice,
    choose,
    subsets,
    updates,
)
from experiments.studies.drift.zeroing import first_of_each, rezeroed, unlabelled
from hdc import HDCClassifier
from hdc.encoders import Reference
from hdc.encoders.relative import FRACTION, standardised
from tests.experiments import composed

SPLIT = Split("random", 0.2)
# Samples of the old session, and of both.
OLD, ASKED = np.arange(40), np.r_[40:60, 72:120]


def built(name):
    return models_of(composed.models(name))[name]


@pytest.fixture(scope="module")
def scene(make_scene):
    return make_scene(n=120, shape=(12, 12), sessions=2)


@pytest.fixture(scope="module")
def choice(scene):
    return choose(scene, SPLIT, 30, seed=0)


def test_no_test_sample_is_learnt_from(scene, choice):
    session, time = scene.samples["session"], scene.samples["order"]
    assert len(choice.old) == 48
    assert not set(choice.old) & set(choice.old_test)
    for samples, of_session in (
        (choice.old, 0),
        (choice.old_test, 0),
        (choice.pool, 1),
        (choice.new_test, 1),
    ):
        assert (session[samples] == of_session).all()
    assert time[choice.pool].max() < time[choice.new_test].min()
    one = replace(scene, samples={"order": time})
    with pytest.raises(ValueError, match="scene: expected two or more sessions, found 1"):
        choose(one, SPLIT, 30, seed=0)


def test_the_first_samples_of_each_class_come_before_the_second():
    """A session that begins with one class only: n samples have all classes nevertheless."""
    labels = np.array([0, 0, 0, 0, 1, 2, 1, 2, 2])
    none = np.array([])
    choice = Choice(none, np.arange(9), none, none)  # in time order
    found = subsets(choice, labels, [3, 9])
    assert found[3].tolist() == [0, 4, 5]
    assert found[9].tolist() == [0, 4, 5, 1, 6, 7, 2, 8, 3]
    with pytest.raises(ValueError, match=r"task\.n_new: expected 1 to 9, found 10"):
        subsets(choice, labels, [3, 10])
    assert subsets(choice, labels, []) == {}


# With labels --------------------------------------------------------------------------------------


class FromOld(PenalisedClassifier):
    """Says which samples lead it away from the old weights, instead of classes."""

    def predict_from_old(self, bank, old, new, asked):
        return new

    solve = curvature = None


def test_each_update_is_trained_on_what_it_is_called(scene, choice, monkeypatch):
    """Of another model than HDC, 48 samples of the old session, and the first
    3 and 18 of the new one, which count as much as the old in ``balanced``."""
    monkeypatch.setattr(measure, "evaluate", lambda model, bank, train, asked: train)
    made = updates(bank_of(scene), choice, FromOld(), [3, 18], (0.5,), seed=0)
    found = [(*about.values(), sorted(train.tolist())) for about, train in made]
    old = sorted(choice.old.tolist())
    expected = [("stored", 0, old)]
    for n, times in ((3, 16), (18, 3)):  # 48/3, and 48/18 rounded
        new = list(range(60, 60 + n))
        expected += [
            ("new", None, n, new),
            ("balanced", None, n, sorted(old + times * new)),
            ("pooled", None, n, old + new),
            ("from_old", None, n, new),
        ]
    assert found == expected


@pytest.mark.parametrize(
    ("readout", "further"),
    [
        ("counts", set()),
        ("lda", set()),
        ("ridge", {"replace"}),
        ("neighbours", {"replace"}),
    ],
)
def test_updates_that_a_read_out_refuses_have_no_row(scene, choice, readout, further):
    model = HDCClassifier(readout=readout)
    made = updates(bank_of(scene), choice, model, [6], (0.5,), seed=0)
    always = {"stored", "new", "pooled", "balanced"}
    assert {about["method"] for about, _ in made} == always | further


# Without labels -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ridge_standardised", "softmax_dual_standardised"])
def test_rivals_are_zeroed_as_the_reference_of_hdc_is(scene, name):
    """By frames themselves: standardised, less the library's reference frame, as floats."""
    before, after = np.arange(40, 50), np.arange(60, 75)
    found = built(name).predict_zeroed(bank_of(scene), OLD, ASKED, before, after)
    steps = 2.0**FRACTION
    values = standardised(scene.images).double() / steps
    references = [
        Reference().zero(scene.images[chosen]).reference_ / steps
        for chosen in (before, after)
    ]
    model = built(name).fit(scene.images[OLD], scene.labels[OLD])
    moved = values[ASKED] - references[1] + references[0]
    scores = moved.float() @ model.weight_.T + model.bias_
    expected = scores.argmax(1).numpy()
    assert (found == expected).mean() > 0.97  # near ties, in float32
    assert len(set(found.tolist())) > 1


@pytest.mark.parametrize("before", [OLD, np.arange(40, 50)], ids=["training", "others"])
@pytest.mark.parametrize("name", ["hdc_reference", "hdc_reference_levels_lda"])
def test_hdc_is_zeroed_by_its_own_recalibration(scene, name, before):
    """By the mean of standardised frames: those that differ much in brightness count alike."""
    images, labels, after = scene.images.clone(), scene.labels, np.arange(60, 75)
    images[np.arange(40, 50, 2)] //= 16
    bank = bank_of(replace(scene, images=images))
    stored, moved = rezeroed(built(name), bank, OLD, ASKED, before, [None, after])
    model = built(name)
    model.encoder.frame = images[before].numpy()
    model.fit(images[OLD], labels[OLD])
    assert (stored == model.predict(images[ASKED])).all()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.rezero(images[after])
    assert (moved == model.predict(images[ASKED])).all()
    assert (moved != stored).any()


def test_unlabelled_frames_are_the_first_with_the_share_that_is_asked_for(scene):
    sizes = [(6, None), (10, None), (600, None), (10, 0.6), (10, 1.0)]
    found = {}
    made = unlabelled(np.arange(60, 120), scene.labels, sizes, favoured=4, n_classes=3)
    for n, share, chosen in made:
        found[n, share] = np.bincount(scene.labels[chosen]).tolist()
        if n == 6:
            assert sorted(chosen) == list(range(60, 66))
    assert found == {
        (6, None): [2, 2, 2],
        (10, None): [4, 3, 3],
        (10, 0.6): [2, 6, 2],  # class 4 modulo 3
        (10, 1.0): [0, 10],
    }
    labels, pool = np.array([0, 1, 0, 1, 0]), np.array([4, 3, 2, 1])
    assert first_of_each(pool, labels, np.array([2, 2])).tolist() == [4, 2, 3, 1]
    assert first_of_each(pool, labels, np.array([3, 1])) is None
