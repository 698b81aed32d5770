"""Calibration error by its definition, and the study on frames whose answers are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.rows import pack_labels, unpack_labels
from experiments.studies.promises.calibration import view
from experiments.studies.promises.calibration.measure import STEPS, calibration
from scenes.frames import Frames

MODELS = {name: configs.part("model", name) for name in ("hdc", "hdc_lda")}
SPLITS = {"random": {"kind": "random", "test_fraction": 0.5, "group": None}}


@pytest.fixture(scope="module")
def rows():
    """Rows of two draws: four classes, drowned so that some are taken for others."""
    rng = np.random.default_rng(2)
    labels = np.tile(np.arange(4), 60)
    base = rng.normal(size=(4, 400))
    frames = 0.18 * base[labels] + rng.normal(size=(240, 400))
    images = np.clip(128 + 35 * frames, 0, 255).astype(np.uint8).reshape(240, 20, 20)
    scene = Frames(torch.from_numpy(images), labels, tuple("ABCD"), origin="simulated")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Run, "scene", lambda *_: scene)
        found = calibration.rows(
            Run(), {}, SPLITS, MODELS, n_per_class=[10, 99], draws=2, most_test=100
        )
        return list(found)


def test_rows_keep_answers_and_how_sure_they_were(rows):
    assert [(row["draw"], row["n"], row["model"]) for row in rows] == [
        (draw, 10, model) for draw in (0, 1) for model in MODELS
    ]
    for row in rows:
        sure = unpack_labels(row["sure"])
        right = unpack_labels(row["predicted"]) == unpack_labels(row["labels"])
        assert len(sure) == len(right) == row["n_test"] == 100
        assert STEPS / 4 <= sure.min() <= sure.max() <= STEPS
        assert abs(sure.mean() / STEPS - right.mean()) < 0.2


def test_the_calibration_error_is_that_of_the_bins():
    sure = np.array([0.95, 0.95, 0.95, 0.95, 0.55, 0.55, 1.0])
    right = np.array([True, True, True, False, True, False, True])
    # Bins of 0.5 to 0.6 and of 0.9 to 1: 2 · |0.55 − 0.5| and 5 · |0.96 − 0.8|.
    expected = (2 * 0.05 + 5 * 0.16) / 7
    assert view.calibration_error(sure, right) == pytest.approx(expected)
    assert view.calibration_error(np.ones(5), np.zeros(5, bool)) == 1
    assert view.calibration_error(np.ones(5), np.ones(5, bool)) == 0


def test_perfect_probabilities_have_an_error_that_falls_with_the_answers():
    """As the mean of |share − p| of n answers: √(2/π)·√(p(1 − p)/n) in each bin."""
    for n in (100, 10_000):
        expected = np.sqrt(2 / np.pi) * np.sqrt(0.7 * 0.3 / n)
        found = view.perfect_error(np.full(n, 0.7))
        assert found == pytest.approx(expected, rel=0.15)


def test_the_table_and_the_figure(rows):
    data = pd.DataFrame(list(view.summary(pd.DataFrame(rows))))
    assert list(data.model) == ["hdc", "hdc_lda"]
    first = [row for row in rows if row["model"] == "hdc"]
    shares = [
        (unpack_labels(row["predicted"]) == unpack_labels(row["labels"])).mean()
        for row in first
    ]
    assert data.accuracy[0] == pytest.approx(np.mean(shares))
    assert data.error_low.isna().all()  # two draws have no interval
    five_times = [
        {**row, "draw": 2 * k + row["draw"]} for k in range(5) for row in rows
    ]
    of_ten = pd.DataFrame(list(view.summary(pd.DataFrame(five_times))))
    assert of_ten.error.tolist() == pytest.approx(data.error.tolist())
    assert (of_ten.error_low <= of_ten.error).all()
    assert (data.perfect < 0.15).all()
    one = pd.DataFrame(rows[:1])
    x, y = view._reliability(one)
    assert len(x) == len(y) >= 1
    assert ((y >= 0) & (y <= 100)).all()
    empty = one.assign(sure=[pack_labels(np.full(100, 250))])
    x, y = view._reliability(empty)
    np.testing.assert_allclose(x, [25])
