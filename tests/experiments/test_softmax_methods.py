"""Methods for one objective: all descend to the same optimum, each as it is expected to."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments import measurement, softmax_methods, stiffness_figures, stiffness_tables

SETTINGS = {"C": 0.1, "budget_s": 0.05, "pixels": ["unit", "unit_centred"], "batch": 10,
            "adam_rates": [1e-4, 1e-2], "dual_steps": [3, 300], "newton_steps": 4}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def parts():
    rng = np.random.default_rng(0)
    labels = np.arange(60) % 3
    base = rng.integers(0, 60, (3, 8, 8))
    frames = torch.from_numpy((base[labels] + rng.integers(0, 190, (60, 8, 8))).astype(np.uint8))
    return (frames[:45], labels[:45]), (frames[45:], labels[45:])


@pytest.fixture(scope="module")
def rows(one_thread, parts):
    return list(softmax_methods.rows(*parts, **SETTINGS))


def test_the_objective_is_that_of_the_models(parts):
    objective = softmax_methods.Objective(*parts, C=0.1)
    best = DualSoftmaxRegression(C=0.1, tol=1e-15).fit(*parts[0])
    found = objective(best)
    assert found["loss_gap"] == pytest.approx(0, abs=1e-7)
    assert found["test_error"] == np.mean(best.predict(parts[1][0]) != parts[1][1])
    # L-BFGS tells the loss of its network before its last steps, which no longer change it.
    for pixels in ("unit", "unit_centred"):
        model = SoftmaxRegression(
            pixels=pixels, optimizer="LBFGS", lr=1.0, batch_size=None, C=0.1, max_epochs=300
        )
        *_, report = model.train(*parts[0])
        assert objective(model)["loss"] == pytest.approx(report["loss"], rel=1e-5)
        assert objective(model)["loss_gap"] == pytest.approx(0, abs=1e-4)
    wrong = SoftmaxRegression(pixels="raw", max_epochs=1).fit(*parts[0])
    with pytest.raises(ValueError, match=r"pixels: expected unit or unit_centred, found 'raw'"):
        objective(wrong)


def test_every_method_goes_down_and_none_below_the_optimum(rows):
    curves = {}
    for row in rows:
        rate = row["rate"] if row["method"] == "Adam" else None
        curves.setdefault((row["method"], row["pixels"], rate), []).append(row)
    assert len(curves) == 2 + 2 + 2 + 1 + 1
    for (method, _, rate), lines in curves.items():
        assert all(line["loss_gap"] > -1e-7 for line in lines)
        assert [x["seconds"] for x in lines if "steps" not in x] == sorted(
            x["seconds"] for x in lines if "steps" not in x
        )
        if rate != 1e-2:  # the largest swings
            assert lines[-1]["loss_gap"] <= lines[0]["loss_gap"], method
    newton = curves["Newton dual", "centred", None]
    assert newton[-1]["loss_gap"] < 1e-3 * newton[0]["loss_gap"]


def test_the_explicit_rate_is_below_its_limit_and_larger_on_centred_pixels(rows):
    rate = {row["pixels"]: row["rate"] for row in rows if row["method"] == "GD"}
    assert rate["unit_centred"] > 2 * rate["unit"]


def test_table_and_figure(tmp_path, rows, monkeypatch):
    text = [{k: str(v) for k, v in row.items()} for row in rows]
    record = {
        "config": {"scene": {"_target_": "scenes.sensor.scene.SpeckleScene"}},
        "environment": {"cpu": "A CPU", "threads": 1, "sources": {}},
    }
    measured = measurement.Measured(text, record)
    table = stiffness_tables.methods(measured)
    assert len(table) == 8
    newton = next(row for row in table if row["method"] == "Newton dual")
    assert newton["seconds_to_0.001"] is not None
    assert "| Newton dual |" in stiffness_tables._methods_text(measured, table)
    monkeypatch.setattr(stiffness_figures.measurement, "read", lambda results, name: measured)
    figure = stiffness_figures.methods(tmp_path)
    labels = {line.get_label() for line in figure.axes[0].lines}
    assert {"Adam, 1e-4", "Adam, 1e-2", "Newton, dual", "L-BFGS, centred"} <= labels
    stiffness_figures.plt.close(figure)
