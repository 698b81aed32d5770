"""The numbers of a row against the records they come from, and the commands that make them."""

import csv
import io

import numpy as np
import pytest

from experiments.records import configs
from experiments.records.groups import Groups
from experiments.records.results import Results
from experiments.reporting import rows
from experiments.reporting.estimates import least_variance, mean_interval
from experiments.reporting.rows import runs_table, swept


def line(tmp_path, model, **place):
    results = Results(tmp_path)
    groups = (
        Groups(results.runs).group("touch", name, **place) for name in (model, "hdc")
    )
    return rows.row(*groups)


def test_numbers_are_those_of_the_records(tmp_path, write_run):
    times, reached = [0.4, 0.3, 0.35], (1, 0.9, 0.95)
    for seed in range(3):
        curve = [{"training_s": times[seed], "train_accuracy": reached[seed]}]
        write_run("hdc", seed=seed, wrong=range(seed), curve=curve)
    row = line(tmp_path, "hdc")
    assert (row["seeds"], row["status"]) == (3, "ok")
    assert row["training_time_s"] == pytest.approx(np.median(times))
    assert row["train_accuracy_max"] == pytest.approx(np.mean(reached))
    assert row["test_accuracy_final"] == pytest.approx((300 - 0 - 1 - 2) / 300)
    student = mean_interval([1, 0.99, 0.98], least_variance([1, 0.99, 0.98], 100))
    assert row["test_accuracy_final_low"] == pytest.approx(student.low)
    assert (row["n_train"], row["pixels"], row["n_test"]) == (400, 250_000, 300)
    assert (row["cpu"], row["threads"], row["over_hdc"]) == ("A CPU", 2, None)


def test_a_model_is_compared_with_hdc(tmp_path, write_run, epochs):
    for seed in range(2):
        write_run("hdc", seed=seed, wrong=[0], curve=[{"training_s": 2.0}])
        write_run(
            "softmax",
            seed=seed,
            wrong=range(1 + 4 * seed),
            curve=epochs(0.5, 0.9, 0.95),
        )
    row = line(tmp_path, "softmax")
    assert row["over_hdc"] == pytest.approx(-0.02)
    assert row["over_hdc_low"] < -0.02 < row["over_hdc_high"]
    assert row["training_time_s"] == 30.0  # 0.9 does not exceed 90 %
    assert row["training_time_over_hdc"] == pytest.approx(15)


def test_not_reached_is_said_never_a_number(tmp_path, write_run, epochs):
    write_run("hdc")
    write_run("cnn1", curve=epochs(0.5, 0.6))
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == "not reached in 20 s"
    assert row["training_time_over_hdc"] is None
    for seed, curve in ((1, epochs(0.95)), (2, epochs(0.5, 0.95))):
        write_run("cnn1", seed=seed, curve=curve)
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == 20.0


def test_a_sweep_has_a_row_for_all_that_it_asks_for(tmp_path, a_full_set):
    params = configs.sweep("accuracy_vs_n")
    lines = swept(Groups(Results(tmp_path).runs), ["accuracy_vs_n", "accuracy_vs_n"])
    assert len(lines) == len(params["model"]) * len(params["split.n_train"])
    measured = {
        (row["model"], row["n_train"]): row["seeds"] for row in lines if row["seeds"]
    }
    assert measured["hdc", 20] == measured["ridge", 100] == 2


def test_every_run_has_a_line_with_what_was_changed(tmp_path, write_run):
    small = write_run("hdc", seed=1, n_train=20, pixels=100, wrong=range(10))
    changed = write_run(
        "cnn1", change={"model.lr": 0.01, "scene.samples_per_class": 20}
    )
    failed = write_run("cnn3", status="failed", error="RuntimeError: no\nmemory")
    text = runs_table(Results(tmp_path)).csv()
    lines = {run["id"]: run for run in csv.DictReader(io.StringIO(text))}
    assert set(lines) == {small, changed, failed}
    run = lines[small]
    known = {"n_train": "20", "pixels": "100", "seed": "1", "code": "current"}
    assert known.items() <= run.items()
    assert run["test_accuracy_final"] == "0.9"
    assert lines[changed]["overrides"] == "scene.samples_per_class=20 model.lr=0.01"
    assert lines[failed]["status"] == "failed: RuntimeError: no\\nmemory"
