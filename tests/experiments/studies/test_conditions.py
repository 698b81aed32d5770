"""Conditions of Table I: sample space is exact, readings and shares are those of the trainings."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn import functional as F

from baselines.descent import Descent
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.conditions import linear, measure
from experiments.studies.conditions.linear import Start
from experiments.studies.conditions.view import STUDY
from scenes.frames import Frames

pytestmark = pytest.mark.usefixtures("one_thread")

TRAIN, TEST = np.arange(20)[::-1].copy(), np.arange(20, 30)
LEVELS = {"90": 0.9, "end": 0.992}


@pytest.fixture
def known(frames_and_labels):
    frames, labels = frames_and_labels(n=30, classes=3, side=12)
    frames = torch.from_numpy(frames)
    return frames, labels, linear.StartProducts(frames, 5, 2, 3)


def scaled(frames, pixels):
    x = frames.flatten(1).double()
    train = x[TRAIN]
    return {
        "raw": x,
        "unit": x / 255,
        "standard_global": (x - train.mean()) / train.std(correction=0),
    }[pixels]


@pytest.mark.parametrize("pixels", ["unit", "raw", "standard_global"])
@pytest.mark.parametrize("batch", [None, 5])
def test_sample_space_is_torch_step_by_step(known, pixels, batch):
    frames, labels, products = known
    rate = 1e-2 if pixels != "raw" else 1e-6
    problem = linear.Problem(products, labels, TRAIN, TEST, pixels)
    logits, _ = problem.start(Start("linear"), 1)
    targets = problem.targets[:20]
    descent = Descent(
        problem.kernel, targets, 3, rate, logits=logits[:, :, None], batch=batch
    )

    x, y = scaled(frames, pixels), torch.from_numpy(labels)
    layer, drawn = (
        nn.Linear(x.shape[1], 3, dtype=torch.float64),
        linear.draw(5, 1, 3, x.shape[1]),
    )
    with torch.no_grad():
        layer.weight.copy_(drawn["uniform"].double() * x.shape[1] ** -0.5)
        layer.bias.copy_(drawn["intercepts"] * x.shape[1] ** -0.5)
    optimiser, parts = torch.optim.SGD(layer.parameters(), rate), descent.parts()
    order = torch.from_numpy(np.concatenate([TRAIN, TEST]))
    for _ in range(8):
        part = next(parts)
        descent.step(part)
        optimiser.zero_grad()
        F.cross_entropy(layer(x[TRAIN][part]), y[TRAIN][part]).backward()
        optimiser.step()
        expected = layer(x[order]).detach()
        torch.testing.assert_close(
            descent.logits[:, :, 0], expected, rtol=1e-8, atol=1e-9
        )


def test_projecting_the_start_is_projecting_its_weights_on_the_span(known):
    frames, labels, products = known
    problem = linear.Problem(products, labels, TRAIN, TEST, "unit")
    logits, shift = problem.start(Start("normal", 0.02), 0)
    x = scaled(frames, "unit")
    weights = linear.draw(5, 0, 3, x.shape[1])["normal"].double() * 0.02
    span = torch.linalg.pinv(x[TRAIN], rtol=1e-9) @ x[TRAIN]
    torch.testing.assert_close(
        x[TEST] @ span @ weights.T, logits[20:] + shift, atol=1e-8, rtol=0
    )
    across = (x[TEST] - x[TEST] @ span).norm(dim=1).mean().item()
    assert problem.across == pytest.approx(across, rel=1e-6)
    assert shift.abs().max() > 1e-3


def test_sizes_of_starts_are_those_of_the_frameworks():
    layer = nn.Linear(5000, 40)
    assert layer.weight.std().item() == pytest.approx(
        Start("linear").sigma(5000, 40), rel=0.01
    )
    glorot = nn.init.xavier_uniform_(layer.weight).std().item()
    assert glorot == pytest.approx(Start("glorot").sigma(5000, 40), rel=0.01)
    drawn = linear.draw(0, 0, 40, 5000)
    for start in (Start("glorot"), Start("normal", 0.02)):
        weights = start.factor(5000, 40) * drawn[start.family]
        assert weights.std().item() == pytest.approx(start.sigma(5000, 40), rel=0.02)


def test_trainings_side_by_side_are_read_as_if_each_were_alone(known):
    _, labels, products = known
    problem = linear.Problem(products, labels, TRAIN, TEST, "unit")
    trainings = [
        (Start("normal", 0.01), 0),
        (Start("normal", 20.0), 1),
        (Start("normal", 1e6), 0),
    ]
    how = {"batch": 5, "reports_per_epoch": 2, "steps": 1200}
    together = measure.train_all(problem, trainings, 0.1, LEVELS, 0, **how)
    alone = [
        measure.train_all(problem, [one], 0.1, LEVELS, 0, **how)[0] for one in trainings
    ]
    assert together == alone
    small, large, never = together
    assert small["steps_90"] <= small["steps_end"] < large["steps_end"]
    assert small["train_end"] >= 0.992
    assert never["steps_end"] is never["test_end"] is None


def test_a_row_a_start_and_draw(frames_and_labels):
    class OnFrames(Run):
        def scene(self, config, seed):
            images, labels = frames_and_labels()
            return Frames(
                torch.from_numpy(images), labels, tuple("abcde"), origin="simulated"
            )

    task = configs.task("table1_conditions")
    del task["_target_"]
    methods = {"GD": {"batch": None, "reports_per_epoch": 1, "steps": 30}}
    small = {"seeds": [1], "draws": 2, "methods": methods, "pixels": ["unit"]}
    rows = list(measure.table1_conditions.rows(OnFrames(), **task | small))
    assert len(rows) == 1 + 7 * 2  # there is one start at zero
    assert {row["origin"] for row in rows} == {"simulated"}
    assert all(0 <= row["hdc"] <= 1 for row in rows)


def trial(test=0.9, train=0.9925, hdc=1.0, steps=100, method="GD", **more):
    row = {"origin": "simulated", "pixels": "unit", "method": method, "start": "normal"}
    row |= {
        "sigma": 0.01,
        "draw": 0,
        "seed": 0,
        "across": 10.0,
        "hdc": hdc,
        "test_90": 0.8,
    }
    end = {
        "steps_end": 2 * steps,
        "train_end": train,
        "test_end": test,
        "projected_end": 1.0,
    }
    return row | {"steps_90": steps} | (end if test else dict.fromkeys(end)) | more


def test_a_condition_is_told_by_the_share_of_trials_within_the_published_intervals(
    tmp_path, write_measurement
):
    inside = [trial()] * 4
    outside = [trial(0.97), trial(train=1.0), trial(hdc=0.95), trial(None)]
    rows = [*inside, trial(0.97)] + [
        row | {"method": "SGD"} for row in [*inside, *outside]
    ]
    config = {
        key: configs.task("table1_conditions")[key]
        for key in ("scene", "split", "methods")
    }
    write_measurement("table1_conditions", rows, config=config)
    (conditions,) = STUDY.tables_of(Results(tmp_path))
    assert conditions.data.set_index("method")["inside"].to_dict() == {
        "GD": 0.8,
        "SGD": 0.5,
    }
