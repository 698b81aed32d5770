"""Values and guarantees: errors of models, and promises that hold where frames come alike."""

import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.linear_model import RidgeCV

from experiments.protocol.task import Context
from experiments.studies.promises.values.measure import Coverage, Values, ridge_values
from scenes.frames import Frames
from tests.experiments import composed

SPLITS = {"random": {"kind": "random", "test_fraction": 0.4, "group": None}}
MODELS = composed.models("hdc", "hdc_lda")


def rows_of(kind, **changed):
    """The rows of a task on the frames of the test."""
    config = composed.task(kind.__name__.lower())
    config |= {"scene": {}, "splits": SPLITS, **changed}
    return list(composed.made(kind, **config).rows(Context()))


@pytest.fixture
def scene(monkeypatch):
    """Frames that a depth from 0 to 10 mm moves along a curve, in four classes."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(0, 10, 200)
    waves = rng.normal(size=(2, 40, 40))
    turns = np.stack([np.cos(depth / 4), np.sin(depth / 4)], axis=1)
    turned = np.tensordot(turns, waves, 1) + 0.5 * rng.normal(size=(200, 40, 40))
    images = torch.from_numpy(np.clip(128 + 25 * turned, 0, 255)).byte()
    made = Frames(images, (depth // 2.5).astype(int), tuple("ABCD"))
    for name, value in {
        "values": depth[:, None],
        "value_names": ("depth",),
        "units": ("mm",),
    }.items():
        object.__setattr__(made, name, value)
    monkeypatch.setattr(Context, "scene", lambda *_: made)


def test_every_model_is_better_than_the_mean(scene):
    rows = rows_of(Values, n_train=[20, 100, 999], draws=1)
    assert {row["n"] for row in rows} == {20, 100}
    error = {row["model"]: row["error"] for row in rows if row["n"] == 100}
    assert error.keys() == {"mean", "ridge_greys", "regressor"}
    assert max(error["ridge_greys"], error["regressor"]) < 0.5 * error["mean"]
    inside = {row["model"]: row["inside"] for row in rows if "inside" in row}
    assert inside.keys() == {"regressor"}
    assert min(inside.values()) > 0.8


@pytest.mark.filterwarnings("ignore:lda. no class has two")
def test_sets_hold_their_promise(scene):
    rows = pd.DataFrame(
        rows_of(Coverage, models=MODELS, n_per_class=[1, 2, 20, 999], draws=4)
    )
    means = rows.groupby("n")[["covered", "size"]].mean()
    assert means.index[:3].tolist() == [1, 2, 20]
    assert means.index[3] > 20  # as many as there are
    few, many = means.iloc[:2], means.iloc[2:]
    assert (few["size"] == 4).all()  # all labels
    assert (many.covered > 0.82).all()
    assert (rows.answers.isna() == (rows.n == 1)).all()  # one frame fits no probability


def test_ridge_of_values_is_that_of_scikit_learn():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(30, 50)), rng.normal(size=20)
    train, queries = x[:20], x[20:]
    products = [torch.from_numpy(part @ train.T) for part in (train, queries)]
    unit = ((train - train.mean(0)) ** 2).sum() / 20
    oracle = RidgeCV(alphas=[unit * 10.0**k for k in range(-4, 5)]).fit(train, y)
    expected = oracle.predict(queries)
    assert ridge_values(*products, y) == pytest.approx(expected, abs=1e-6)
