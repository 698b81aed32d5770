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
from experiments.protocol.evaluate import bank_of
from experiments.protocol.experiment import Run
from experiments.protocol.model import models_of
from experiments.records import configs
from experiments.reporting.sessions import update_name, with_right
from experiments.studies.drift import view
from experiments.studies.drift.measure import choose, drift, subsets, updates
from experiments.studies.drift.numbers import (
    best_updates,
    ratio,
    regained,
)
from experiments.studies.drift.zeroing import Unlabelled, rezeroed, untouched, zeroed
from hdc import HDCClassifier
from hdc.encoders import Reference
from hdc.encoders.reference import FRACTION, standardised
from scenes.frames import Frames

SPLIT = {"kind": "random", "test_fraction": 0.2, "n_train": None}
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


@pytest.mark.parametrize("order", ["time", "random"])
def test_no_test_sample_is_learnt_from(scene, order):
    choice = choose(scene, SPLIT, 30, order, seed=0)
    session, time = scene.samples["session"], scene.samples["order"]
    assert len(choice.old) == 48
    assert (session[choice.tests["old"]] == 0).all()
    assert (session[choice.tests["new"]] == 1).all()
    by_size = subsets(choice, scene.labels, [3, 9, 30], order, seed=0)
    for n, chosen in by_size.items():
        assert len(set(chosen) - set(choice.tests["new"])) == n
        assert (session[chosen] == 1).all()
        assert len(set(np.bincount(scene.labels[chosen]))) == 1
    assert set(by_size[3]) < set(by_size[9])
    if order == "time":
        assert time[by_size[30]].max() < time[choice.tests["new"]].min()


def scores(scene, model, n_new=30):
    """{(method, p): (right of the new, right of the old)}."""
    choice = choose(scene, SPLIT, 30, "time", seed=0)
    made = updates(
        bank_of(scene), choice, model, [n_new], (0, 0.5, 1), "time", 1, seed=0
    )
    found = {}
    for about, predicted in made:
        right = predicted == scene.labels[choice.asked]
        key = about["method"], about.get("p")
        found[key] = int(right[:30].sum()), int(right[30:].sum())
    return found


def test_every_update_of_prototypes_is_a_classifier_of_those_samples(scene):
    right = scores(scene, HDCClassifier())
    choice = choose(scene, SPLIT, 30, "time", seed=0)
    new = subsets(choice, scene.labels, [30], "time", seed=0)[30]
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
    rows = pd.DataFrame(
        drift.rows(
            Run(), **common, n_new=[2, 4], p=[0.5], order=["time", "random"], draws=2
        )
    )
    # Stored models, and 4 + 4 + 4 + 3 updates of one choice in time order and of two others.
    assert len(rows) == 2 * 4 + 3 * 2 * 15
    assert set(rows.groupby("order").labels.count()) == {1}
    counted = with_right(rows)
    assert (counted.right_new <= rows.n_test_new).all()
    assert (counted.right_old <= rows.n_test_old).all()
    assert (counted.right_new + counted.right_old).min() > 0
    assert ((rows.method == "stored") == (rows.n_new == 0)).all()
    with pytest.raises(
        ValueError, match=r"task\.order: .* time, random, found \['late'\]"
    ):
        next(drift.rows(Run(), **common, n_new=[2], p=[0.5], order=["late"]))


def test_accuracies_are_means_over_seeds_and_draws():
    """p = 0.5 has 90 and 94 % in two seeds, new alone 80 and 83; two draws each, 1 point apart."""
    rows = pd.DataFrame([
        {"origin": "simulated", "seed": seed, "order": "time", "model": "hdc", "method": method,
         "p": p, "n_old": 400, "n_new": n, "draw": draw, "n_test_new": 10_000, "n_test_old": 50,
         "right_new": 100 * (right[seed] + (-1) ** draw), "right_old": 45}
        for seed in (0, 1) for draw in (0, 1)
        for method, p, n, right in (("stored", None, 0, (30, 30)), ("new", None, 50, (80, 83)),
                                    ("replace", 0.5, 50, (90, 94)))
    ])  # fmt: skip
    table = view.recalibration(rows, {}).set_index("update")
    assert table.loc["bits replaced, p = 0.5", "new_50"] == pytest.approx(0.92)
    assert table.loc["new samples alone", "new_50"] == pytest.approx(0.815)
    assert table.loc["not updated", "new_5"] == pytest.approx(0.3)
    stored, recovered = view.quantities(rows, {})
    assert (stored.value, stored.n, stored.seeds) == (pytest.approx(30), 20_000, 2)
    assert recovered.value == pytest.approx(92)


# Without labels -----------------------------------------------------------------------------------

RIVALS = (
    "ridge_standardised",
    "softmax_dual_standardised",
    "knn_greys_standardised",
    "thumbnail_standardised",
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
    if name.startswith("knn"):
        nearest = torch.cdist(moved, values[train]).argmin(1)
        expected = scene.labels[train][nearest.numpy()]
    elif name.startswith("thumbnail"):
        # Of differences: a thumbnail as it is, of frames that are standardised already.
        plain = replace(model, pixels="raw")
        features = plain.features(moved.reshape(-1, 12, 12).float())
        expected = model._logits(features).argmax(1).numpy()
    else:
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
        model.recalibrate(scene.images[after])
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


def test_the_share_regained_is_a_ratio_of_means():
    """Before 90 and 80 %, stored 40 and 50, updated 80 and 65: 55 of 80 points."""
    common = {"order": "time", "model": "hdc", "p": None, "draw": 0}
    common |= {"n_test_new": 1000, "n_test_old": 1000}
    lines = []
    for seed, old, stored, updated in ((0, 900, 400, 800), (1, 800, 500, 650)):
        same = {**common, "seed": seed, "right_old": old}
        lines.append({**same, "method": "stored", "n_new": 0, "right_new": stored})
        lines.append({**same, "method": "new", "n_new": 50, "right_new": updated})
        lines.append(
            {**same, "method": "pooled", "n_new": 50, "right_new": updated - 9}
        )
        lines.append({**same, "method": "zeroed", "n_new": 90, "right_new": stored})
    found = regained(pd.DataFrame(lines))
    new = found[found.method == "new"].iloc[0]
    assert new.before == pytest.approx(0.85)
    assert new.lost == pytest.approx(0.4)
    assert new.regained == pytest.approx(0.55 / 0.8)
    assert new.regained_low < new.regained < new.regained_high
    assert new.labels
    assert set(best_updates(found).method) == {"new", "zeroed"}


def test_a_ratio_without_a_loss_is_none():
    assert np.isnan(ratio(pd.Series([0.1, 0.2]), pd.Series([0.0, -0.1])).value)


def test_updates_in_words():
    assert update_name("replace", 0.5, np.nan) == "bits replaced, p = 0.5"
    assert update_name("zeroed", None, 0.6) == "re-zeroed, 60 % of one class"
    assert update_name("zeroed", None, 1.0) == "re-zeroed, one class only"
    assert update_name("zeroed", None, None) == "re-zeroed, all classes alike"
