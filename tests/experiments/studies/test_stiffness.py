"""Stiffness: Hessians are exact, limits are where theory has them."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
import torch
from torch.nn import functional as F

from baselines.softmax import SoftmaxRegression
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.limits.stiffness import measure, softmax
from experiments.studies.limits.stiffness.view import crossing
from experiments.studies.limits.view import STUDY
from scenes.frames import Frames

pytestmark = pytest.mark.usefixtures("one_thread")


def frames_of(n=20, classes=2, side=8):
    rng = np.random.default_rng(0)
    labels = np.arange(n) % classes
    base = rng.integers(0, 60, (classes, side, side))
    frames = base[labels] + rng.integers(0, 190, (n, side, side))
    return torch.from_numpy(frames.astype(np.uint8)), labels


@pytest.mark.parametrize("pixels", ["raw", "unit", "standard"])
def test_the_kernel_is_that_of_the_scaled_frames(pixels):
    frames, labels = frames_of()
    gram, targets = softmax.kernel(pixels, frames, labels)
    model = SoftmaxRegression(pixels=pixels, max_epochs=1).fit(frames, labels)
    x = model.scaling_(frames).flatten(1).double()
    torch.testing.assert_close(gram, x @ x.T, rtol=1e-4, atol=1e-4)
    assert targets.tolist() == labels.tolist()


def test_the_spectrum_is_that_of_the_hessian():
    frames, labels = frames_of(n=6, classes=3, side=3)
    gram, targets = softmax.kernel("unit", frames, labels)
    inputs = torch.cat(
        [frames.flatten(1).double() / 255, torch.ones(6, 1).double()], dim=1
    )
    zero = torch.zeros(6, 3).double(), torch.zeros(3).double()
    for a, b in (zero, softmax.optimum(gram, targets, 0.05)):
        weights = torch.cat([a.T @ inputs[:, :-1], b[:, None]], dim=1)
        hessian = torch.autograd.functional.hessian(
            lambda w: F.cross_entropy(inputs @ w.T, targets), weights
        )
        exact = torch.linalg.eigvalsh(hessian.reshape(30, 30)).flip(0).numpy()
        np.testing.assert_allclose(
            softmax.spectrum(gram, gram @ a + b, 4), exact[:4], rtol=1e-9
        )
        if a is zero[0]:
            start = np.repeat(softmax.start_spectrum(gram, 3), 2)
            np.testing.assert_allclose(start, exact[:12], rtol=1e-9)


@pytest.mark.parametrize(
    ("losses", "rises", "exceeds", "ends_above"),
    [
        ([2.0, 1.0, 0.5], False, False, False),
        ([2.0, 1.0, 1.5], True, False, False),
        ([2.0, 3.0, 1.0], True, True, False),
        ([2.0, 3.0, 4.0], True, True, True),
        ([2.0, math.nan], True, True, True),
        ([2.0, math.inf], True, True, True),
        ([2.0, 2.0 + 1e-15], False, False, True),
    ],
)
def test_verdicts(losses, rises, exceeds, ends_above):
    row = measure.verdict(losses)
    assert (row["rises"], row["exceeds"], row["ends_above"]) == (
        rises,
        exceeds,
        ends_above,
    )


def test_descent_from_the_optimum_loses_its_hold_at_two_over_lambda(
    tmp_path, write_measurement
):
    class OnFrames(Run):
        def scene(self, config, seed):
            return Frames(*frames_of(60, 3), ("a", "b", "c"), origin="simulated")

    config = configs.task("stiffness") | {
        "seed": 0,
        "steps": 60,
        "epochs": 3,
        "penalty": 0.1,
    }
    config |= {"exponents": [-2, -1, 0, 2]}
    del config["_target_"]
    rows = list(measure.stiffness.rows(OnFrames(), **config))
    write_measurement("stiffness", rows, config=config)
    (table,) = STUDY.tables_of(Results(tmp_path))
    assert len(table.data) == 9
    assert "simulated frames" in table.title
    limits = table.data[table.data["start"] == "optimum"]
    # Between 2^-1/4 and 2^1/4 of the prediction, the two rates next to it.
    assert limits["exceeds_over_predicted"].tolist() == pytest.approx([1, 1, 1])


@pytest.mark.parametrize(
    ("happens", "limit"),
    [("nyy", math.sqrt(0.5)), ("nnn", "> 2.00"), ("yyy", "< 0.500")],
)
def test_a_limit_lies_between_two_rates(happens, limit):
    sweep = pd.DataFrame({"rate": [2.0, 0.5, 1.0]})
    sweep["rises"] = [happens[2] == "y", happens[0] == "y", happens[1] == "y"]
    assert crossing(sweep, "rises") == (
        limit if isinstance(limit, str) else pytest.approx(limit)
    )
