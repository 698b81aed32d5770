"""Recalibration: updates do what they are called, and no test sample was learnt from."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from baselines.correlation import CorrelationClassifier
from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.experiment import Run
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.records import configs
from experiments.records.rows import pack_labels, unpack_labels
from experiments.studies.drift import measure, view
from experiments.studies.drift.measure import (
    Answers,
    Choice,
    choose,
    drift,
    subsets,
    updates,
    ways,
    zeroings,
)
from experiments.studies.drift.numbers import (
    best_updates,
    ratio,
    regained,
)
from experiments.studies.drift.sessions import update_name, with_right
from experiments.studies.drift.zeroing import (
    Unlabelled,
    first_of_each,
    rezeroed,
    untouched,
    zeroed,
)
from hdc import HDCClassifier
from hdc.encoders import Reference
from hdc.encoders.standardised import FRACTION, standardised
from hdc.readouts import Counts
from scenes.frames import Frames

SPLIT = Split("random", 0.2)
MODELS = {
    name: configs.part("model", name)
    for name in ("hdc", "ridge", "softmax_dual", "correlation")
}


@pytest.fixture(scope="module")
def scene():
    """Frames of three classes that look different in each of two sessions."""
    rng = np.random.default_rng(1)
    labels, session = np.tile(np.arange(60) % 3, 2), np.repeat([0, 1], 60)
    base = rng.integers(0, 200, (2, 3, 12, 12))
    frames = base[session, labels] + rng.integers(0, 50, (120, 12, 12))
    samples = {"session": session, "order": np.tile(np.arange(60), 2)}
    return Frames(
        torch.from_numpy(frames.astype(np.uint8)), labels, ("A", "B", "C"), samples
    )


def test_no_test_sample_is_learnt_from(scene):
    choice = choose(scene, SPLIT, 30, seed=0)
    session, time = scene.samples["session"], scene.samples["order"]
    assert len(choice.old) == 48
    assert (session[choice.tests["old"]] == 0).all()
    assert (session[choice.tests["new"]] == 1).all()
    by_size = subsets(choice, scene.labels, [3, 9, 30])
    for n, chosen in by_size.items():
        assert len(set(chosen) - set(choice.tests["new"])) == n
        assert (session[chosen] == 1).all()
        assert len(set(np.bincount(scene.labels[chosen]))) == 1
    assert set(by_size[3]) < set(by_size[9])
    assert time[by_size[30]].max() < time[choice.tests["new"]].min()


def scores(scene, model, n_new=30):
    """{(method, p): (right of the new, right of the old)}."""
    choice = choose(scene, SPLIT, 30, seed=0)
    made = updates(bank_of(scene), choice, model, [n_new], (0, 0.5, 1), seed=0)
    found = {}
    for about, predicted in made:
        right = predicted == scene.labels[choice.asked]
        key = about["method"], about.get("p")
        found[key] = int(right[:30].sum()), int(right[30:].sum())
    return found


def test_every_update_of_prototypes_is_a_classifier_of_those_samples(scene):
    right = scores(scene, HDCClassifier())
    choice = choose(scene, SPLIT, 30, seed=0)
    new = subsets(choice, scene.labels, [30])[30]
    for key, train in {
        ("stored", None): choice.old,
        ("replace", 0.0): choice.old,
        ("new", None): new,
        ("replace", 1.0): new,
        ("pooled", None): np.concatenate([choice.old, new]),
    }.items():
        model = HDCClassifier().fit(scene.images[train], scene.labels[train])
        for room, tests in enumerate((choice.tests["new"], choice.tests["old"])):
            expected = (model.predict(scene.images[tests]) == scene.labels[tests]).sum()
            assert right[key][room] == expected
    assert right["stored", None][0] < right["new", None][0] == 30
    assert right["balanced", None] == (30, 12)


@pytest.fixture
def asked_what(monkeypatch):
    """Models say which samples they were trained on, instead of classes."""
    monkeypatch.setattr(measure, "evaluate", lambda model, bank, train, asked: train)


def test_each_update_is_trained_on_what_it_is_called(scene, asked_what):
    """Of another model than HDC, 48 samples of the old session, and the first
    3 and 18 of the new one, which count as much as the old in ``balanced``."""
    choice = choose(scene, SPLIT, 30, seed=0)
    bank = bank_of(scene)
    made = updates(bank, choice, object(), [3, 18], (0.5,), seed=0)
    found = [(about, sorted(train.tolist())) for about, train in made]
    old = sorted(choice.old.tolist())
    expected = [({"method": "stored", "n_new": 0}, old)]
    for n, times in ((3, 16), (18, 3)):  # 48/3, and 48/18 rounded
        about = {"p": None, "n_new": n}
        new = list(range(60, 60 + n))
        expected += [
            ({"method": "new", **about}, new),
            ({"method": "balanced", **about}, sorted(old + times * new)),
            ({"method": "pooled", **about}, old + new),
        ]
    assert found == expected


def test_more_new_samples_than_there_are_is_an_error_that_names_the_key(scene):
    choice = choose(scene, SPLIT, 30, seed=0)
    with pytest.raises(ValueError, match=r"task\.n_new: expected 1 to 30, found 31"):
        subsets(choice, scene.labels, [3, 31])
    assert list(subsets(choice, scene.labels, [30])) == [30]
    assert subsets(choice, scene.labels, []) == {}


def test_one_session_alone_has_no_drift(scene):
    samples = {"order": scene.samples["order"]}
    with pytest.raises(ValueError, match=r"split\.test: .*sessions \[0\]"):
        choose(replace(scene, samples=samples), SPLIT, 30, seed=0)


def test_updates_of_hdc_are_its_own_recalibrations(scene):
    """Which bits are replaced depends on the seed."""
    bank, labels = bank_of(scene), scene.labels
    old, new, asked = np.arange(40), np.arange(60, 72), np.arange(72, 120)
    found = {
        (name, p): predicted
        for name, p, predicted in ways(
            HDCClassifier(), bank, old, new, asked, (0.3, 1.0), seed=7
        )
    }
    assert list(found) == [
        ("new", None),
        ("replace", 0.3),
        ("replace", 1.0),
        ("balanced", None),
        ("pooled", None),
    ]
    for key, options in (
        (("replace", 0.3), {"p": 0.3, "method": "replace"}),
        (("replace", 1.0), {"p": 1.0, "method": "replace"}),
        (("balanced", None), {"p": 0.5, "method": "merge"}),  # half of all votes
    ):
        model = HDCClassifier().fit(scene.images[old], labels[old])
        model.recalibrate(scene.images[new], labels[new], seed=7, **options)
        assert (found[key] == model.predict(scene.images[asked])).all()
    made = ways(HDCClassifier(), bank, old, new, asked, (2.0,), seed=7)
    with pytest.raises(ValueError, match="p: "):
        list(made)


class OwnCounts(Counts):
    """Refuses a method in words of its own."""

    def adapt(self, words, rows, share, seed, method):
        if method not in self.methods:
            raise ValueError(f"I only know {self.methods}")
        super().adapt(words, rows, share, seed, method)


def own_counts():
    return HDCClassifier(readout=OwnCounts())


@pytest.mark.parametrize(
    "make",
    [lambda: built("hdc_lda"), lambda: built("hdc_integer"), own_counts],
    ids=["lda", "integer", "own"],
)
def test_an_update_that_a_read_out_does_not_have_has_no_row(scene, make):
    """It was told by the start of an error."""
    old, new, asked = np.arange(40), np.arange(60, 72), np.arange(72, 120)
    made = ways(make(), bank_of(scene), old, new, asked, (0.5,), seed=0)
    assert [way for way, *_ in made] == ["new", "balanced", "pooled"]


def test_the_whole_row_of_an_answer():
    """Two old samples, three test samples of the new session and one of the old; the first row has
    their classes."""
    scene = Frames(
        torch.zeros(6, 2, 2, dtype=torch.uint8),
        np.array([0, 1, 2, 0, 1, 2]),
        ("A", "B", "C"),
    )
    tests = {"new": np.array([5, 4, 3]), "old": np.array([2])}
    answers = Answers(bank_of(scene), Choice(np.array([0, 1]), np.array([]), tests))
    said = np.array([2, 2, 0, 1])
    same = {
        "n_old": 2,
        "n_test_new": 3,
        "n_test_old": 1,
        "predicted": pack_labels(said),
    }
    assert answers.row({"method": "stored", "n_new": 0}, said) == {
        "method": "stored",
        "n_new": 0,
        "p": None,
        "share": None,
        **same,
        "labels": pack_labels([2, 1, 0, 2]),
    }
    about = {"method": "replace", "p": 0.5, "share": 0.25, "n_new": 2}
    assert answers.row(about, said) == {**about, **same}


@pytest.mark.parametrize(
    "kind", [RidgeReadout, DualSoftmaxRegression, CorrelationClassifier]
)
def test_linear_models_start_from_old_weights(scene, kind):
    right = scores(scene, kind(), n_new=3)
    assert right["stored", None][1] == right["pooled", None][1] == 12
    assert (("from_old", None) in right) == (kind is not CorrelationClassifier)
    if (
        kind is not CorrelationClassifier
    ):  # one frame a class is enough, and nothing is forgotten
        assert right["from_old", None] == (30, 12)


def test_rows_of_a_small_experiment(small_scene):
    rooms = [
        {"_target_": "scenes.sensor.environment.Room", "offset": k} for k in (0, 0.5)
    ]
    two = {**small_scene, "sessions": rooms}
    common = {
        "scene": two,
        "old_split": SPLIT,
        "models": MODELS,
        "seeds": [0],
        "n_test": 8,
    }
    rows = pd.DataFrame(drift.rows(Run(), **common, n_new=[2, 4], p=[0.5]))
    # Stored models, and 4 + 4 + 4 + 3 updates by two sizes.
    assert len(rows) == 4 + 2 * 15
    assert rows.labels.count() == 1
    counted = with_right(rows)
    assert (counted.right_new <= rows.n_test_new).all()
    assert (counted.right_old <= rows.n_test_old).all()
    assert (counted.right_new + counted.right_old).min() > 0
    assert ((rows.method == "stored") == (rows.n_new == 0)).all()


def test_accuracies_are_means_over_seeds(predicting):
    """p = 0.5 has 90 and 94 % in two seeds, new alone 80 and 83."""
    rows = [
        {"origin": "simulated", "seed": seed, "model": "hdc", "method": method,
         "p": p, "n_old": 400, "n_new": n, "n_test_new": 10_000, "n_test_old": 50,
         "right_new": 100 * right[seed], "right_old": 45}
        for seed in (0, 1)
        for method, p, n, right in (("stored", None, 0, (30, 30)), ("new", None, 50, (80, 83)),
                                    ("replace", 0.5, 50, (90, 94)))
    ]  # fmt: skip
    rows = pd.DataFrame(map(predicting, rows))
    table = regained(rows).set_index("update")
    assert table.loc["bits replaced, p = 0.5", "updated"] == pytest.approx(0.92)
    assert table.loc["new samples alone", "updated"] == pytest.approx(0.815)
    assert table.stored.tolist() == pytest.approx([0.3, 0.3])
    assert table.old.tolist() == pytest.approx([0.9, 0.9])
    stored, recovered = view.quantities(rows)
    assert (stored.value, stored.n, stored.seeds) == (pytest.approx(30), 20_000, 2)
    assert recovered.value == pytest.approx(92)


# Without labels -----------------------------------------------------------------------------------

RIVALS = (
    "ridge_standardised",
    "softmax_dual_standardised",
)


def built(name):
    return models_of({name: configs.part("model", name)})[name]


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_are_zeroed_as_the_reference_of_hdc_is(scene, name):
    """By frames themselves: standardised, less the library's reference frame, as floats."""
    train, before, after = np.arange(40), np.arange(40, 50), np.arange(60, 75)
    asked = np.arange(80, 120)
    found = built(name).predict_zeroed(bank_of(scene), train, asked, before, after)
    steps = 2.0**FRACTION
    values = standardised(scene.images).double() / steps
    references = [
        Reference().zero(scene.images[chosen]).reference_ / steps
        for chosen in (before, after)
    ]
    model = built(name).fit(scene.images[train], scene.labels[train])
    moved = values[asked] - references[1] + references[0]
    scores = moved.float() @ model.weight_.T + model.bias_
    expected = scores.argmax(1).numpy()
    assert (found == expected).mean() > 0.97  # near ties, in float32
    assert len(set(found.tolist())) > 1


@pytest.mark.parametrize("name", ["hdc_reference", "hdc_reference_levels_lda"])
def test_hdc_is_zeroed_by_its_own_recalibration(scene, name):
    train, after, asked = np.arange(50), np.arange(60, 75), np.arange(80, 120)
    bank = bank_of(scene)
    stored, moved = rezeroed(built(name), bank, train, asked, train, [None, after])
    model = built(name).fit(scene.images[train], scene.labels[train])
    assert (stored == model.predict(scene.images[asked])).all()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.rezero(scene.images[after])
    assert (moved == model.predict(scene.images[asked])).all()
    assert (moved != stored).any()


@pytest.mark.parametrize("name", ["hdc_reference", "hdc_reference_levels_lda"])
def test_the_reference_of_hdc_is_the_mean_of_standardised_frames_too(scene, name):
    """As of its rivals: frames before the drift that differ much in brightness count alike."""
    images, dimmed = scene.images.clone(), np.arange(40, 50, 2)
    images[dimmed] //= 16
    bank = bank_of(replace(scene, images=images))
    train, before, after = np.arange(40), np.arange(40, 50), np.arange(60, 75)
    asked = np.arange(80, 120)
    stored, moved = rezeroed(built(name), bank, train, asked, before, [None, after])
    model = built(name)
    model.encoder.frame = images[before].numpy()
    model.fit(images[train], scene.labels[train])
    steps = standardised(images[before]).sum(0, dtype=torch.int64) // len(before)
    assert torch.equal(model.encoder_.reference_, steps)
    assert (stored == model.predict(images[asked])).all()
    model.encoder_.zero(images[after])
    assert (moved == model.predict(images[asked])).all()
    raw = built(name)
    raw.encoder.frame = images[before].double().mean(0).numpy()
    raw.fit(images[train], scene.labels[train])
    assert (stored != raw.predict(images[asked])).any()


def test_models_that_cannot_be_zeroed_are_named(scene):
    rows = np.arange(30)
    for name, found in (("hdc", "Median"), ("correlation", "CorrelationClassifier")):
        made = rezeroed(built(name), bank_of(scene), rows, rows, rows, [rows])
        with pytest.raises(TypeError, match=rf"task\.zeroing: .*found {found}"):
            next(made)


def test_unlabelled_frames_have_the_share_that_is_asked_for(scene):
    pool = np.arange(60, 120)
    frames = Unlabelled([6, 10, 600], [0.6, 1.0], [10], [1, 99], favoured=4)
    found = list(frames.choices(pool, scene.labels, 3))
    counts = {
        (n, share): np.bincount(scene.labels[c], minlength=3) for n, share, c in found
    }
    assert counts.keys() == {(6, None), (10, None), (10, 0.6), (10, 1.0)}
    assert counts[6, None].tolist() == [2, 2, 2]
    assert counts[10, None].tolist() == [4, 3, 3]
    assert counts[10, 0.6].tolist() == [2, 6, 2]  # class 4 modulo 3
    assert counts[10, 1.0].tolist() == [0, 10, 0]
    _, _, first = found[0]
    assert sorted(first) == [60, 61, 62, 63, 64, 65]  # the first in time
    old = np.arange(40)
    model = built("ridge_standardised")
    bank = bank_of(scene)
    rows = [about for about, _ in zeroed(model, bank, old, pool, pool, frames)]
    assert [row["method"] for row in rows] == ["stored"] + 4 * ["zeroed"]
    rows = [about for about, _ in untouched(model, bank, old, pool, pool, frames, 1)]
    assert rows == [{"method": "untouched", "n_new": 1}]


def test_the_first_of_each_class_need_as_many_as_there_are():
    labels, pool = np.array([0, 1, 0, 1, 0]), np.array([4, 3, 2, 1])
    assert first_of_each(pool, labels, np.array([2, 2])).tolist() == [4, 2, 3, 1]
    assert first_of_each(pool, labels, np.array([1, 0])).tolist() == [4]
    assert first_of_each(pool, labels, np.array([3, 1])) is None


@pytest.mark.parametrize("name", ["ridge_standardised", "hdc_reference"])
def test_the_rows_of_a_zeroing(scene, name):
    """The stored model; it re-zeroed by six frames of all classes, by ten with six of class 1; one
    trained on the first three new samples; and one that has a reference of class 2 alone."""
    model, bank = built(name), bank_of(scene)
    choice = choose(scene, SPLIT, 30, seed=0)
    old, asked, labels = choice.old, choice.asked, scene.labels
    frames = Unlabelled([6], [0.6], [10], [4], favoured=1)
    found = list(zeroings(bank, choice, model, [3], frames, no_touch=2))
    abouts = [about for about, _ in found]
    assert abouts == [
        {"method": "stored", "n_new": 0},
        {"method": "zeroed", "n_new": 6, "share": None},
        {"method": "zeroed", "n_new": 10, "share": 0.6},
        {"method": "new", "n_new": 3},
        {"method": "untouched", "n_new": 4},
    ]
    # Classes follow each other in time from sample 60 on.
    six = np.arange(60, 66)
    ten = np.array([60, 63, 61, 64, 67, 70, 73, 76, 62, 65])
    stored, by_six, by_ten = rezeroed(model, bank, old, asked, old, [None, six, ten])
    new = evaluate(model, bank, np.arange(60, 63), asked)
    before, after = old[labels[old] == 2], np.array([62, 65, 68, 71])
    (without,) = rezeroed(model, bank, old, asked, before, [after])
    expected = [stored, by_six, by_ten, new, without]
    for (about, predicted), answer in zip(found, expected, strict=True):
        assert (predicted == answer).all(), about
    made = zeroings(bank, choice, model, [], frames, no_touch=None)
    assert [about["method"] for about, _ in made] == ["stored", "zeroed", "zeroed"]


def test_rows_of_a_small_experiment_without_labels(scene, monkeypatch):
    """Of the seeds that are asked for; the class without touch by its name."""
    two = replace(scene, classes=("A", "B", "None"))
    monkeypatch.setattr(
        Run, "scenes", lambda run, scene, seeds: ((seed, two) for seed in seeds)
    )
    options = {
        "zeroing": {"ridge": configs.part("model", "ridge_standardised")},
        "zeroing_seeds": [1], "n_alone": [3], "n_zero": [6], "shares": [0.6],
        "n_shares": [10], "n_untouched": [4],
    }  # fmt: skip
    common = {
        "scene": {}, "old_split": SPLIT, "models": {"hdc": MODELS["hdc"]},
        "seeds": [0, 1], "n_test": 30, "n_new": [3], "p": [],
    }  # fmt: skip
    rows = pd.DataFrame(drift.rows(Run(), **common, **options, no_touch="None"))
    of_zeroing = rows[rows.model == "ridge"]
    assert set(of_zeroing.seed) == {1}
    methods = ["stored", "zeroed", "zeroed", "new", "untouched"]
    assert of_zeroing.method.tolist() == methods
    assert of_zeroing.n_new.tolist() == [0, 6, 10, 3, 4]
    assert of_zeroing.share.dropna().tolist() == [0.6]
    of_hdc = rows[rows.model == "hdc"]
    assert of_hdc.method.tolist() == 2 * ["stored", "new", "balanced", "pooled"]
    assert of_hdc.seed.tolist() == 4 * [0] + 4 * [1]
    truth = unpack_labels(rows.labels.iloc[0])
    choice = choose(two, SPLIT, 30, seed=0)
    assert (truth == two.labels[choice.asked]).all()
    # The share of ten frames is of class 1, the seed: 60, 63, six of class 1, 62, 65.
    choice = choose(two, SPLIT, 30, seed=1)
    ten = np.array([60, 63, 61, 64, 67, 70, 73, 76, 62, 65])
    (expected,) = rezeroed(
        built("ridge_standardised"),
        bank_of(two),
        choice.old,
        choice.asked,
        choice.old,
        [ten],
    )
    assert (unpack_labels(of_zeroing.predicted.iloc[2]) == expected).all()
    rows = pd.DataFrame(drift.rows(Run(), **common, **options, no_touch="air"))
    assert rows[rows.model == "ridge"].method.tolist() == methods[:-1]


def test_the_whole_row_of_what_an_update_regains(predicting):
    """Accuracies in two seeds as in the next test; t(0.975, 1) = 12.7062."""
    rows = []
    for seed, old, stored, updated in ((0, 90, 40, 80), (1, 80, 50, 65)):
        for method, n, share, right in (
            ("stored", 0, None, stored),
            ("zeroed", 10, 0.6, updated),
            ("zeroed", 10, None, stored),
        ):
            rows.append(
                {"model": "hdc", "p": None, "seed": seed,
                 "method": method, "n_new": n, "share": share, "right_new": right * 100,
                 "right_old": old * 10, "n_test_new": 10_000, "n_test_old": 1000}
            )  # fmt: skip
    found = regained(pd.DataFrame(map(predicting, rows))).to_dict("records")
    assert len(found) == 2
    half = 12.7062 * 0.05  # of two shares 10 points apart
    shares = {
        "before": (0.85, 0.85 - half, 1.0),
        "stored": (0.45, 0.0, 1.0),
        "updated": (0.725, 0.0, 1.0),
        "old": (0.85, 0.85 - half, 1.0),
        "lost": (0.4, 0.4 - 2 * half, 0.4 + 2 * half),
        # Of gains 0.4 and 0.15: 0.6875 + (gain − 0.6875·lost)/0.4 is 0.828 and 0.547.
        "regained": (0.6875, 0.6875 - 12.7062 * 0.140625, 0.6875 + 12.7062 * 0.140625),
    }
    expected = {"model": "hdc", "method": "zeroed", "share": 0.6,
                "update": "re-referenced, 60 % of one class", "n_new": 10,
                "labels": False}  # fmt: skip
    for name, numbers in shares.items():
        keys = (name, f"{name}_low", f"{name}_high")
        expected |= dict(zip(keys, map(close, numbers), strict=True))
    assert found[0] == expected
    assert found[1]["update"] == "re-referenced, all classes alike"
    assert found[1]["regained"] == 0


def close(number):
    return pytest.approx(number, rel=1e-4, abs=1e-9)


def test_the_best_update_has_the_highest_mean_and_few_labels(predicting):
    """Right answers of 1000 in one session; of 60 labelled frames the paper has no number."""
    common = {"model": "hdc", "p": None, "seed": 0}
    common |= {"n_test_new": 1000, "n_test_old": 1000, "right_old": 900}
    found = (("stored", 0, 400), ("new", 50, 800), ("pooled", 50, 790))
    found += (("pooled", 60, 880), ("zeroed", 90, 400))
    lines = [
        {**common, "method": method, "n_new": n, "right_new": right}
        for method, n, right in found
    ]
    best = best_updates(regained(pd.DataFrame(map(predicting, lines))))
    assert list(zip(best.method, best.n_new, best.labels, strict=True)) == [
        ("new", 50, True),
        ("zeroed", 90, False),
    ]


def test_a_ratio_without_a_loss_is_none():
    assert np.isnan(ratio(np.array([0.1, 0.2]), np.array([0.0, -0.1])).value)


def test_updates_in_words():
    assert update_name("replace", 0.5, np.nan) == "bits replaced, p = 0.5"
    assert update_name("zeroed", None, 0.6) == "re-referenced, 60 % of one class"
    assert update_name("zeroed", None, None) == "re-referenced, all classes alike"
