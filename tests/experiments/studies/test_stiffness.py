"""Stiffness: sample space is exact, Hessians are Hessians, the limit is where it is said to be."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt
from torch.nn import functional as F

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.studies.stiffness import measure as stiffness
from experiments.studies.stiffness import networks as stiffness_networks
from experiments.studies.stiffness import softmax as dual
from experiments.studies.stiffness.view import STUDY
from experiments.studies.stiffness.view_limits import limits, published_rate

pytestmark = pytest.mark.usefixtures("one_thread")

SETTINGS = {
    "softmax": {
        "pixels": ["unit", "standard"],
        "steps": 60,
        "epochs": 3,
        "penalty": 0.1,
        "exponents": [-2, -1, 0, 2, 4],
        "eigenvalues": 3,
    },
    "adam": {"epochs": 1, "exponents": [0]},
    "networks": {
        "n": 10,
        "side": 8,
        "steps": 2,
        "exponents": [-6],
        "adam": {"epochs": 1, "exponents": [0]},
    },
    "batch": 5,
}


def frames_and_labels(n=20, classes=2, side=8):
    rng = np.random.default_rng(0)
    labels = np.arange(n) % classes
    base = rng.integers(0, 60, (classes, side, side))
    return torch.from_numpy(
        (base[labels] + rng.integers(0, 190, (n, side, side))).astype("uint8")
    ), labels


@pytest.mark.parametrize("pixels", ["raw", "unit", "standard"])
@pytest.mark.parametrize("batch", [None, 5])
def test_descent_in_the_space_of_samples_is_descent(pixels, batch):
    frames, labels = frames_and_labels(classes=4)
    problem = dual.problem(pixels, frames, labels, 5)
    rate = 0.3 / dual.start_spectrum(problem)[0]
    model = SoftmaxRegression(
        pixels=pixels, optimizer="SGD", lr=rate, batch_size=batch, max_epochs=1, init="zeros"
    )
    model.fit(frames, labels)
    *_, (_, state) = dual.descend(problem, rate, 1, batch=batch)
    logits = model.scores(frames).detach().double()
    torch.testing.assert_close(logits, problem.logits(state), rtol=1e-4, atol=1e-5)
    loss = F.cross_entropy(logits, problem.targets).item()
    assert problem.loss(state) == pytest.approx(loss, rel=1e-4)


def test_the_spectrum_is_that_of_the_hessian():
    frames, labels = frames_and_labels(n=6, classes=3, side=3)
    problem = dual.problem("unit", frames, labels, 3)
    inputs = torch.cat([frames.flatten(1).double() / 255, torch.ones(6, 1).double()], dim=1)
    states = [problem.start(), dual.optimum(problem, 0.05)]
    for state in states:
        weights = torch.cat([state.a.T @ inputs[:, :-1], state.b[:, None]], dim=1)

        def loss(w):
            return F.cross_entropy(inputs @ w.T, problem.targets)

        assert loss(weights).item() == pytest.approx(problem.loss(state), rel=1e-12)
        hessian = torch.autograd.functional.hessian(loss, weights).reshape(30, 30)
        exact = torch.linalg.eigvalsh(hessian).flip(0).numpy()
        np.testing.assert_allclose(dual.spectrum(problem, state, 4), exact[:4], rtol=1e-9)
        if state is states[0]:
            np.testing.assert_allclose(
                np.repeat(dual.start_spectrum(problem), 2), exact[:12], rtol=1e-9
            )


@pytest.mark.parametrize("pixels", ["raw", "unit", "standard"])
def test_the_optimum_is_one_and_loses_its_hold_at_two_over_lambda(pixels):
    frames, labels = frames_and_labels(classes=3)
    problem = dual.problem(pixels, frames, labels, 5)
    penalty = 0.1 * dual.start_spectrum(problem).mean()
    best = dual.optimum(problem, penalty)
    floor, limit = problem.loss(best, penalty), 2 / dual.spectrum(problem, best, 1, penalty)[0]
    assert all(floor <= loss for loss, _ in dual.descend(problem, limit / 2, 20, penalty=penalty))
    near = dual.State(best.a * 1.001, best.b)
    gaps = {
        factor: [
            loss - floor
            for loss, _ in dual.descend(problem, factor * limit, 200, start=near, penalty=penalty)
        ]
        for factor in (0.9, 1.15)
    }
    assert gaps[0.9][-1] < gaps[0.9][0] / 3
    assert gaps[1.15][-1] > 3 * gaps[1.15][0]


def test_networks_and_the_space_of_samples_agree():
    # With two classes the slopes of both are equal, and so is their mean.
    frames, labels = frames_and_labels()
    problem = dual.problem("unit", frames, labels, 5)
    model = SoftmaxRegression(batch_size=5, init="zeros")
    found = stiffness_networks.start(model, frames, labels, 5)
    assert found.loss == pytest.approx(math.log(2), rel=1e-6)
    assert found.lambda_max == pytest.approx(dual.start_spectrum(problem)[0], rel=0.02)
    assert found.adam_limit == pytest.approx(problem.adam_limit, rel=0.02)
    assert not hasattr(model, "network_")


def test_a_network_s_sharpness_is_its_hessian_s():
    frames, labels = frames_and_labels(n=6)
    model = CNN(filters=(1,), max_epochs=1).fit(frames, labels)
    inputs = model.scaling_(frames)[:, None]
    names, weights = zip(*model.network_.named_parameters(), strict=True)

    def loss(flat):
        parts = torch.split(flat, [w.numel() for w in weights])
        named = {n: p.view_as(w) for n, p, w in zip(names, parts, weights, strict=True)}
        return F.cross_entropy(
            torch.func.functional_call(model.network_, named, inputs), torch.from_numpy(labels)
        )

    flat = torch.cat([w.detach().flatten() for w in weights])
    exact = torch.linalg.eigvalsh(torch.autograd.functional.hessian(loss, flat))[-1].item()
    assert stiffness_networks.sharpness(model, frames, labels) == pytest.approx(exact, rel=0.02)


def test_the_window_is_the_middle():
    frames = torch.arange(2 * 5 * 6, dtype=torch.uint8).reshape(2, 5, 6)
    assert torch.equal(stiffness_networks.window(frames, 3), frames[:, 1:4, 1:4])
    assert torch.equal(stiffness_networks.window(frames, 9), frames)


@pytest.mark.parametrize(
    ("losses", "rises", "exceeds", "ends_above"),
    [
        ([2.0, 1.0, 0.5], "no", "no", "no"),
        ([2.0, 1.0, 1.5], "yes", "no", "no"),
        ([2.0, 3.0, 1.0], "yes", "yes", "no"),
        ([2.0, 3.0, 4.0], "yes", "yes", "yes"),
        ([2.0, math.nan], "yes", "yes", "yes"),
        ([2.0, math.inf], "yes", "yes", "yes"),
        ([2.0, 2.0 + 1e-15], "no", "no", "yes"),
    ],
)
def test_verdicts(losses, rises, exceeds, ends_above):
    row = stiffness.verdict(losses)
    assert (row["rises"], row["exceeds"], row["ends_above"]) == (rises, exceeds, ends_above)


@pytest.fixture(scope="module")
def rows(one_thread):
    frames, labels = frames_and_labels(n=40)
    return list(stiffness.rows(frames, labels, **SETTINGS))


@pytest.fixture
def results(tmp_path, write_measurement, rows):
    write_measurement("stiffness", rows, config={"scene": configs.task("stiffness")["scene"]})
    return Results(tmp_path)


def test_limits_from_rows(results):
    found = limits(results.measured("stiffness"))
    by_sweep = {(r["model"], r["pixels"], r["method"], r["start"]): r for r in found}
    assert len(by_sweep) == len(found) == 2 * 4 + 2 * 2
    for pixels in ("unit", "standard"):
        row = by_sweep["softmax", pixels, "GD", "optimum"]
        # Between 2^-1/4 and 2^1/4 of the prediction, the two rates next to it.
        assert row["exceeds_over_predicted"] == pytest.approx(1)
        assert row["within_factor_2"] == "yes"
    (table,) = STUDY.tables(results)
    assert table.name == "stiffness"
    assert len(table.cells()) == len(found)
    assert "simulated frames" in table.title
    assert "A CPU, 2 threads" in table.note
    assert "published rate is 1.0e-04" in table.note


@pytest.mark.parametrize(
    ("exceeding", "method", "ends", "limit", "why"),
    [
        ("nyy", "GD", (), math.sqrt(2) / 2, None),
        ("nnn", "GD", (9.0, 9.0, 0.5), "> 2.00", "separated .* falls to 0.500"),
        ("nnn", "SGD", (), "> 2.00", "separated before the swings grow$"),
        ("yyy", "Adam", (), "< 0.500", "first steps"),
        ("yyy", "GD", (40.0,), "< 0.500", "sharpens .* to 40.0"),
        ("yyy", "GD", (), "< 0.500", "no bound along the way"),
    ],
)
def test_a_limit_that_is_not_where_it_was_predicted_is_explained(
    tmp_path, write_measurement, exceeding, method, ends, limit, why
):
    rates = (0.5, 1.0, 2.0)
    rows = [
        {
            **{"kind": "sweep", "model": "softmax", "pixels": "unit", "method": method},
            **{"start": "zero", "n": 4, "d": 9, "lambda_max": 2.0, "predicted": 1.0, "rate": rate},
            **dict.fromkeys(("rises", "exceeds", "ends_above"), {"y": "yes", "n": "no"}[letter]),
            "lambda_end": ends[k] if k < len(ends) else "",
        }
        for k, (rate, letter) in enumerate(zip(rates, exceeding, strict=True))
    ]
    write_measurement("stiffness", rows, config={"scene": configs.task("stiffness")["scene"]})
    (row,) = limits(Results(tmp_path).measured("stiffness"))
    assert row["exceeds"] == (limit if isinstance(limit, str) else pytest.approx(limit))
    assert row["within_factor_2"] == ("no" if why else "yes")
    assert row["why_not"] is None if why is None else re.search(why, row["why_not"])


def test_the_published_rate_is_set_beside_what_was_found():
    def row(pixels, method, exceeds):
        sweep = {"model": "softmax", "start": "zero", "pixels": pixels, "method": method}
        return {**sweep, "exceeds": exceeds}

    text = published_rate([row("unit", "Adam", 9.6e-4), row("raw", "GD", "> 2.0e-08")])
    assert "published rate is 1.0e-04" in text
    assert "9.6e-04 (0…1, Adam, batches of 20), > 2.0e-08 (0…255, gradient descent)." in text
    assert published_rate([]) == ""


def test_own_frames_have_tables_and_figures_of_their_own(tmp_path, write_measurement, rows):
    scene = {**configs.task("stiffness")["scene"], "samples_per_class": 8}
    write_measurement("stiffness", rows, config={"scene": scene})
    (tmp_path / "measured" / "stiffness").rename(tmp_path / "measured" / "stiffness-abc")
    (table,) = STUDY.tables(Results(tmp_path))
    assert table.name == "stiffness_abc"
    assert "scene.samples_per_class=8" in table.note
    names = {plot.name for plot in STUDY.plots(Results(tmp_path))}
    assert names == {"stiffness_limit_abc", "stiffness_spectrum_abc"}


def test_figures_are_drawn_from_rows(results):
    drawn = {plot.name: plot.draw() for plot in STUDY.plots(results)}
    first = drawn["stiffness_limit"].axes[0].lines[0].get_xdata()
    np.testing.assert_allclose(first, 2.0 ** (np.array([-2, -1, 0, 2, 4]) / 2 + 0.25))
    with_points = [x for x in drawn["stiffness_spectrum"].axes[0].lines if len(x.get_xdata())]
    assert len(with_points) == 4  # two scalings, at the start and at the optimum
    for figure in drawn.values():
        plt.close(figure)


def test_the_task_measures_on_frames_of_the_scene(tmp_path, monkeypatch, small_scene):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    split = {"kind": "random", "test_fraction": 0.25, "n_train": None}
    folder = stiffness.run(small_scene, split, 1, cache=False, **SETTINGS)
    found = measurement.read(folder)
    assert found.record.status == "finished"
    assert {row["n"] for row in found.rows if row["model"] == "softmax"} == {"12"}
    assert {row["d"] for row in found.rows if row["model"] == "softmax"} == {"3600"}
    assert "scenes/sensor/scene.py" in found.record.environment.sources
    assert not (tmp_path / "cache").exists()
