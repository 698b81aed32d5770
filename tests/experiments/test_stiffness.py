"""Stiffness: sample space is exact, Hessians are Hessians, the limit is where it is said to be."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from experiments import stiffness, stiffness_networks, stiffness_tables
from experiments import stiffness_softmax as dual
from experiments.measurement import Measured, to_csv

SETTINGS = {
    "softmax": {"pixels": ["unit", "standard"], "steps": 60, "epochs": 3, "penalty": 0.1,
                "exponents": [-2, -1, 0, 2, 4], "eigenvalues": 3},
    "adam": {"epochs": 1, "exponents": [0]},
    "networks": {"n": 10, "side": 8, "steps": 2, "exponents": [-6],
                 "adam": {"epochs": 1, "exponents": [0]}},
    "batch": 5,
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


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
        pixels=pixels, optimizer="SGD", lr=rate, batch_size=batch, max_epochs=1
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
        weights = torch.cat([
            state.a.T @ inputs[:, :-1], state.b[:, None]
        ], dim=1)  # fmt: skip

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
        factor: [loss - floor for loss, _ in dual.descend(
            problem, factor * limit, 200, start=near, penalty=penalty)]
        for factor in (0.9, 1.15)
    }  # fmt: skip
    assert gaps[0.9][-1] < gaps[0.9][0] / 3
    assert gaps[1.15][-1] > 3 * gaps[1.15][0]


def test_networks_and_the_space_of_samples_agree():
    # With two classes the slopes of both are equal, and so is their mean.
    frames, labels = frames_and_labels()
    problem = dual.problem("unit", frames, labels, 5)
    model = SoftmaxRegression(batch_size=5)
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
        return F.cross_entropy(torch.func.functional_call(model.network_, named, inputs),
                               torch.from_numpy(labels))  # fmt: skip

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
    row = stiffness._verdict(losses)
    assert (row["rises"], row["exceeds"], row["ends_above"]) == (rises, exceeds, ends_above)


@pytest.fixture(scope="module")
def measured(one_thread):
    frames, labels = frames_and_labels(n=40)
    rows = list(stiffness.rows(frames, labels, **SETTINGS))
    text = list(csv.DictReader(to_csv(rows).splitlines()))
    record = {
        "config": {"scene": {"_target_": "scenes.sensor.scene.SpeckleScene"}},
        "environment": {"cpu": "A CPU", "threads": 1, "sources": {}},
    }
    return Measured([{k: v for k, v in row.items() if v} for row in text], record)


def test_limits_from_rows(measured):
    rows = stiffness_tables.limits(measured)
    found = {(r["model"], r["pixels"], r["method"], r["start"]): r for r in rows}
    assert len(found) == len(rows) == 2 * 4 + 2 * 2
    for pixels in ("unit", "standard"):
        row = found["softmax", pixels, "GD", "optimum"]
        # Between 2^-1/4 and 2^1/4 of the prediction, the two rates next to it.
        assert row["exceeds_over_predicted"] == pytest.approx(1)
        assert row["within_factor_2"] == "yes"
    text = stiffness_tables._limits_text(measured, rows)
    assert "simulated frames. A CPU, 1 thread." in text
    assert "Why 1e-4?" in text


def test_a_paragraph_on_the_published_rate_says_what_the_rows_say():
    def row(pixels, method, predicted):
        return {"model": "softmax", "start": "zero", "pixels": pixels, "method": method,
                "predicted": predicted}  # fmt: skip

    text = stiffness_tables.why_1e_4([row("unit", "GD", 9.6e-4), row("raw", "GD", 2e-8)])
    assert "9.6e-4 (gradient descent): the largest power of ten below it is 1e-4, the" in text
    assert "1e-4 is 5000 times that" in text
    other = stiffness_tables.why_1e_4([row("unit", "GD", 2.5e-3), row("unit", "SGD", 2e-4)])
    assert "below each is 1e-4 or 1e-3 (published: 1e-4)" in other
    assert stiffness_tables.why_1e_4([]) == ""


def test_figures_are_drawn_from_rows_and_are_none_without(tmp_path, measured, monkeypatch):
    from experiments import stiffness_figures

    assert stiffness_figures.stability_limit(tmp_path) is None
    assert stiffness_figures.spectrum(tmp_path) is None
    assert stiffness_figures.methods(tmp_path) is None
    monkeypatch.setattr(stiffness_figures.measurement, "read", lambda results, name: measured)
    figure = stiffness_figures.stability_limit(tmp_path)
    first = figure.axes[0].lines[0].get_xdata()
    np.testing.assert_allclose(first, 2.0 ** (np.array([-2, -1, 0, 2, 4]) / 2 + 0.25))
    spectrum = stiffness_figures.spectrum(tmp_path)
    assert len(spectrum.axes[0].lines) == 4  # two scalings, at the start and at the optimum
    for drawn in (figure, spectrum):
        stiffness_figures.plt.close(drawn)
