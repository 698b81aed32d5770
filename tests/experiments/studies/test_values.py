"""Values and guarantees: errors of models, and promises that hold where frames come alike."""

import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.linear_model import RidgeCV

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.promises.values import view
from experiments.studies.promises.values.measure import coverage, values
from experiments.studies.promises.values.numbers import ridge_values
from experiments.studies.promises.view import STUDY
from scenes.frames import Frames

SPLITS = {"random": {"kind": "random", "test_fraction": 0.4, "group": None}}
MODELS = {name: configs.part("model", name) for name in ("hdc", "hdc_lda")}


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
    assert error["regressor"] < error["bins"] < 0.5 * error["mean"]
    inside = {row["model"]: row["inside"] for row in rows if "inside" in row}
    assert inside.keys() == {"regressor", "nearest_neighbour"}
    assert min(inside.values()) > 0.8


def test_values_below_the_least_are_left_out(scene):
    rows = list(values.rows(Run(), {}, SPLITS, n_train=[20], draws=1, at_least=5.0))
    assert 25 < rows[0]["n_test"] < 55
    (mean,) = (row["error"] for row in rows if row["model"] == "mean")
    assert mean < 1.6  # of 5 mm; of all 10 mm, it is 2.5


def test_sets_hold_their_promise_and_noise_is_refused(
    scene, monkeypatch, tmp_path, drawn
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    coverage(
        name="coverage",
        scene_name="spr",
        scene={},
        splits=SPLITS,
        models=MODELS,
        n_per_class=[1, 2, 20, 999],
        draws=4,
    )
    promises, every = STUDY.tables_of(Results(tmp_path))
    assert promises.data.model.tolist() == ["hdc"] * 4 + ["hdc_lda"] * 4
    least, _, middle, most = promises.data.n[:4]
    assert (least, middle) == (1, 20)
    assert most > 20  # as many as there are
    for row in every.data.to_dict("records"):
        if row["n"] < 4:
            assert (row["covered"], row["size"]) == (1, 4)  # all labels
            continue
        assert row["covered"] > 0.82
        assert row["refused"] < 0.18
        assert row["unknown_refused"] == 1
        assert 0 <= row["calibration"] < 0.3
    once = every.data[every.data.n == 1]
    assert once.calibration.isna().all()  # one frame fits no probability
    assert "same session" in drawn(STUDY)["calibration"]


def bins_of(sure, right):
    """A row of one model with these probabilities and right answers, by the definition."""
    place = np.minimum(np.floor(10 * sure), 9)
    parts = [place == b for b in range(10)]
    return pd.DataFrame(
        {
            "answers": [[part.sum() for part in parts]],
            "right": [[right[part].sum() for part in parts]],
            "sure": [[sure[part].sum() for part in parts]],
            "spread": [[(sure * (1 - sure))[part].sum() for part in parts]],
        }
    )


def test_the_calibration_error_is_that_of_the_bins():
    sure = np.array([0.95, 0.95, 0.95, 0.95, 0.55, 0.55, 1.0])
    right = np.array([True, True, True, False, True, False, True])
    found = view._calibration(bins_of(sure, right)).iloc[0]
    # Bins of 0.5 to 0.6 and of 0.9 to 1: 2 · |0.55 − 0.5| and 5 · |0.96 − 0.8|.
    assert found["calibration"] == pytest.approx((2 * 0.05 + 5 * 0.16) / 7)
    assert found["accuracy"] == pytest.approx(5 / 7)


def test_perfect_probabilities_have_the_error_of_chance():
    rng = np.random.default_rng(0)
    sure = rng.uniform(0.5, 1, 1000)
    rows = [bins_of(sure, rng.random(1000) < sure) for _ in range(200)]
    drawn = view._calibration(pd.concat(rows))
    expected = drawn.calibration.mean()
    assert drawn.perfect.iloc[0] == pytest.approx(expected, rel=0.1)


def test_a_bin_of_few_answers_is_not_drawn():
    sure, right = np.repeat([0.25, 0.85], [19, 20]), np.arange(39) % 2 == 0
    x, y = view.reliability(bins_of(sure, right))
    np.testing.assert_allclose((x, y), [[85], [50]])


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
