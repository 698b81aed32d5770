"""Values and guarantees: errors of models, and promises that hold where frames come alike."""

import numpy as np
import pytest
import torch
from sklearn.linear_model import RidgeCV

from experiments.protocol.experiment import Run
from experiments.records.results import Results
from experiments.studies.promises import view
from experiments.studies.promises.values.measure import coverage, ridge_values, values
from scenes.frames import Frames

SPLITS = {"random": {"kind": "random", "test_fraction": 0.4, "group": None}}


@pytest.fixture
def scene(monkeypatch):
    """Frames that a depth from 0 to 10 mm moves along a curve, in four classes."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(0, 10, 200)
    waves = rng.normal(size=(2, 40, 40))
    turned = (
        np.cos(depth / 4)[:, None, None] * waves[0]
        + np.sin(depth / 4)[:, None, None] * waves[1]
    )
    images = np.clip(128 + 25 * (turned + 0.5 * rng.normal(size=turned.shape)), 0, 255)
    scene = Frames(
        torch.from_numpy(images.astype(np.uint8)),
        (depth // 2.5).astype(int),
        tuple("ABCD"),
    )
    about = {"values": depth[:, None], "value_names": ("depth",), "units": ("mm",)}
    noise = Frames(
        torch.randint(0, 255, (20, 40, 40)).to(torch.uint8), np.zeros(20, int), ("X",)
    )
    for name, value in (about | {"unknown": noise}).items():
        object.__setattr__(scene, name, value)
    monkeypatch.setattr(Run, "scene", lambda *_: scene)


def test_every_model_is_better_than_the_mean_and_ridge_than_ten_bins(scene):
    rows = list(values.rows(Run(), {}, SPLITS, n_train=[20, 100, 999], draws=1))
    assert {row["n"] for row in rows} == {20, 100}
    error = {row["model"]: row["error"] for row in rows if row["n"] == 100}
    assert max(error, key=error.get) == "mean"
    assert error["ridge_bits"] < error["bins"] < 0.5 * error["mean"]
    assert error["regressor"] == pytest.approx(
        error["ridge_bits"], rel=0.02
    )  # weights of 8 bits
    (last,) = (row for row in rows if row["model"] == "regressor" and row["n"] == 100)
    assert np.all(np.subtract(last["covered"], [0.8, 0.9, 0.95]) > -0.1)
    assert last["width"] == sorted(last["width"])


def test_values_below_the_least_are_left_out(scene):
    rows = list(values.rows(Run(), {}, SPLITS, n_train=[20], draws=1, at_least=5.0))
    assert 25 < rows[0]["n_test"] < 55
    (mean,) = (row["error"] for row in rows if row["model"] == "mean")
    assert mean < 1.6  # of 5 mm; of all 10 mm, it is 2.5


def test_sets_hold_their_promise_and_noise_is_refused(scene, monkeypatch, tmp_path):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    coverage(
        name="coverage",
        scene_name="spr",
        scene={},
        splits=SPLITS,
        n_per_class=[2, 20, 999],
        draws=4,
    )
    table, few = view.STUDY.tables_of(Results(tmp_path))
    assert few.data.n.iloc[0] == 2
    assert few.data.covered_80.iloc[0] == 1  # every set has all four labels
    assert few.data.size_80.iloc[0] == 4
    assert few.data.n.iloc[-1] > 20  # as many as there are
    assert few.data.size_80.iloc[-1] < 2
    assert set(table.data.n) == {few.data.n.iloc[-1]}
    for row in table.data.to_dict("records"):
        assert row["covered"] >= row["promised"] - 0.08
        assert row["refused"] <= 1 - row["promised"] + 0.08
        assert row["unknown_refused"] == 1


def test_ridge_of_values_is_that_of_scikit_learn():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(30, 50)), rng.normal(size=30)
    train, queries, y = x[:20], x[20:], y[:20]
    products = [torch.from_numpy(part @ train.T) for part in (train, queries)]
    unit = ((train - train.mean(0)) ** 2).sum() / 20
    expected = (
        RidgeCV(alphas=[unit * 10.0**k for k in range(-4, 5)])
        .fit(train, y)
        .predict(queries)
    )
    assert ridge_values(*products, y) == pytest.approx(expected, abs=1e-6)
