"""Every run in one plain table, whatever its configuration, whatever came of it."""

import csv
import io

from experiments.records.results import Results
from experiments.reporting.runs import COLUMNS, runs_table


def lines(folder):
    return list(csv.DictReader(io.StringIO(runs_table(Results(folder)).csv())))


def test_a_run_is_there_with_what_was_changed(tmp_path, write_run):
    ids = [
        write_run("hdc"),
        write_run("hdc", seed=1, n_train=20, pixels=100, wrong=range(10)),
        write_run("cnn1", change={"model.lr": 0.01, "scene.samples_per_class": 20}),
        write_run("cnn3", status="failed", error="RuntimeError: no\nmemory"),
    ]
    found = {line["id"]: line for line in lines(tmp_path)}
    assert set(found) == set(ids)
    plain, small, changed, failed = (found[name] for name in ids)
    assert list(plain) == list(COLUMNS)
    assert (plain["overrides"], plain["status"], plain["code"]) == ("", "finished", "current")
    assert (small["n_train"], small["pixels"], small["seed"]) == ("20", "100", "1")
    assert small["test_accuracy_final"] == "0.9"
    assert changed["overrides"] == "scene.samples_per_class=20 model.lr=0.01"
    assert failed["status"] == "failed: RuntimeError: no\\nmemory"
    assert failed["training_s"] == ""


def test_without_runs_there_are_its_columns(tmp_path):
    assert runs_table(Results(tmp_path)).csv() == ",".join(COLUMNS) + "\n"
