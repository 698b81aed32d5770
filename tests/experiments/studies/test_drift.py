"""Recalibration: updates do what they are called, and no test sample was learnt from."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch

from baselines.correlation import CorrelationClassifier
from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.evaluate import bank_of
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.drift import view
from experiments.studies.drift.measure import choose, drift, subsets, updates
from hdc import HDCClassifier
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
    rows = updates(
        bank_of(scene), choice, model, [n_new], (0, 0.5, 1), "time", 1, seed=0
    )
    return {
        (row["method"], row["p"]): (row["right_new"], row["right_old"]) for row in rows
    }


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
    assert (rows.right_new <= rows.n_test_new).all()
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
