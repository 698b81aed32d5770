"""Methods for one objective: all descend to the same optimum, each as it is expected to."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt

from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.reporting.table import records
from experiments.studies.stiffness import methods as softmax_methods
from experiments.studies.stiffness.view import STUDY

pytestmark = pytest.mark.usefixtures("one_thread")

SETTINGS = {
    "C": 0.1,
    "budget_s": 0.05,
    "pixels": ["unit", "unit_centred"],
    "batch": 10,
    "adam_rates": [1e-4, 1e-2],
    "dual_steps": [3, 300],
    "newton_steps": 4,
}


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


def test_table_and_figure(tmp_path, rows, write_measurement):
    scene = configs.task("softmax_methods")["scene"]
    write_measurement("softmax_methods", rows, config={"scene": scene})
    results = Results(tmp_path)
    (table,) = STUDY.tables(results)
    assert table.name == "softmax_methods"
    assert len(table.data) == 8
    newton = next(row for row in records(table.data) if row["method"] == "Newton dual")
    assert newton["seconds_to_0.001"] is not None
    assert newton["rate"] is None
    (plot,) = STUDY.plots(results)
    figure = plot.draw()
    labels = {line.get_label() for line in figure.axes[0].lines}
    assert {"Adam, 1e-04", "Adam, 1e-02", "Newton, dual", "L-BFGS, centred"} <= labels
    plt.close(figure)


def test_of_adam_the_published_rate_and_the_best_are_drawn(tmp_path, write_measurement):
    rest = {"seconds": 1.0, "test_error": 0.0}
    rows = [
        {"method": "Adam", "pixels": "unit", "rate": rate, "loss_gap": gap, **rest}
        for rate, gap in ((1e-5, 0.3), (1e-4, 0.2), (1e-3, 0.1), (1e-2, 0.4))
    ]
    scene = configs.task("softmax_methods")["scene"]
    write_measurement("softmax_methods", rows, config={"scene": scene})
    (plot,) = STUDY.plots(Results(tmp_path))
    figure = plot.draw()
    lines = {line.get_label(): line.get_linestyle() for line in figure.axes[0].lines}
    assert lines == {"Adam, 1e-04": ":", "Adam, 1e-03": "-"}
    plt.close(figure)


def test_the_task_trains_and_tests_on_frames_of_the_scene(tmp_path, monkeypatch, small_scene):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    split = {"kind": "random", "test_fraction": 0.25, "n_train": None}
    few = {**SETTINGS, "budget_s": 0.01, "dual_steps": [3], "newton_steps": 1}
    folder = softmax_methods.run(small_scene, split, 1, cache=False, **few)
    found = measurement.read(folder)
    assert found.record.status == "finished"
    assert {row["method"] for row in found.rows} == {
        "GD",
        "Adam",
        "L-BFGS",
        "GD dual",
        "Newton dual",
    }
    assert all(4 * float(row["test_error"]) % 1 == 0 for row in found.rows)  # four test samples
