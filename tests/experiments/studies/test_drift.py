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
from experiments.protocol.task import Context
from experiments.records.rows import unpack_labels
from experiments.studies.drift import measure
from experiments.studies.drift.measure import (
    Choice,
    Drift,
    choose,
    rezeroed,
    subsets,
    updates,
)
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
    with pytest.raises(
        ValueError, match="scene: expected two or more sessions, found 1"
    ):
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
        ("majority", {"replace"}),
        ("counts", set()),
        ("lda", set()),
        ("neighbours", set()),
    ],
)
def test_bits_are_replaced_in_the_published_form_alone(scene, choice, readout, further):
    model = HDCClassifier(readout=readout)
    made = updates(bank_of(scene), choice, model, [6], (0.5,), seed=0)
    always = {"stored", "new", "pooled", "balanced"}
    assert {about["method"] for about, _ in made} == always | further


# Without labels -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ridge_standardised", "softmax_dual_standardised"])
def test_rivals_are_zeroed_as_the_reference_of_hdc_is(scene, name):
    """By frames themselves: standardised, less the library's reference frame, as floats."""
    after = np.arange(60, 75)
    (found,) = rezeroed(built(name), bank_of(scene), OLD, ASKED, [after])
    steps = 2.0**FRACTION
    values = standardised(scene.images).double() / steps
    references = [
        Reference().zero(scene.images[chosen]).reference_ / steps
        for chosen in (OLD, after)
    ]
    model = built(name).fit(scene.images[OLD], scene.labels[OLD])
    moved = values[ASKED] - references[1] + references[0]
    scores = moved.float() @ model.weight_.T + model.bias_
    expected = scores.argmax(1).numpy()
    assert (found == expected).mean() > 0.97  # near ties, in float32
    assert len(set(found.tolist())) > 1


@pytest.mark.parametrize("name", ["hdc_reference", "hdc_reference_levels_lda"])
def test_hdc_is_zeroed_by_its_own_recalibration(scene, name):
    """Its own mean is the reference that it was trained with."""
    images, labels, after = scene.images, scene.labels, np.arange(60, 75)
    stored, moved = rezeroed(built(name), bank_of(scene), OLD, ASKED, [OLD, after])
    model = built(name).fit(images[OLD], labels[OLD])
    assert (stored == model.predict(images[ASKED])).all()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.rezero(images[after])
    assert (moved == model.predict(images[ASKED])).all()
    assert (moved != stored).any()


def test_unlabelled_frames_are_of_all_classes_or_of_one(scene, monkeypatch):
    """Those of one class are the first in time of the class whose turn it is."""
    monkeypatch.setattr(measure, "rezeroed", lambda *given: given[-1])
    monkeypatch.setattr(Context, "scenes", lambda *_: [(4, scene)])
    config = composed.task("drift") | {"scene": {}, "models": {}, "n_alone": []}
    config |= {"old_split": {"kind": "random", "test_fraction": 0.2}, "n_test": 30}
    config |= {"zeroing": composed.models("hdc_reference"), "seeds": [4]}
    config |= {"n_zero": [6, 600], "n_one_class": [8, 600]}
    rows = composed.made(Drift, **config).rows(Context())
    stored, alike, one_class = (unpack_labels(row["predicted"]) for row in rows)
    assert len(stored) == 48
    assert alike.tolist() == [*range(60, 66)]
    assert one_class.tolist() == [*range(61, 85, 3)]  # class 4 modulo 3
