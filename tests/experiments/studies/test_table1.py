"""Table I: what a limit proves, and what is disturbed; the rest is recomputed."""

import pytest

from experiments.reporting.table import records
from experiments.studies.table1.view import STUDY


def reports(*pairs, step=10.0):
    """The curve of a model that learns by steps, of pairs of training and test accuracy."""
    return [
        {"training_s": step * k, "loss": 1.0, "train_accuracy": train, "test_accuracy": test}
        for k, (train, test) in enumerate(pairs, 1)
    ]  # fmt: skip


@pytest.fixture
def table(answers):
    """table() → the row of Table I and its cells after the name, by model."""

    def read():
        made = answers(STUDY).table("table1")
        rows = records(made.data)
        both = zip(rows, made.cells(), strict=True)
        return {row["model"]: (row, cells[1:]) for row, cells in both}

    return read


def test_a_training_that_ended_at_a_limit_shows_what_that_proves(table, write_run):
    write_run("hdc")
    curve = reports((0.3, 0.4), (0.468, 0.4), step=68.5)
    beside = {"beside.hdc_s": 0.0913}
    write_run("cnn3", curve=curve, **beside)
    _, cells = table()["cnn3"]
    assert cells[:2] == ["> 137: 46.8 % in training", "> 1,500"]
    # A seed that passed 90 % has an accuracy there; how many did stands beside the mean.
    write_run("cnn3", seed=1, curve=reports((0.95, 0.4)), **beside)
    line, _ = table()["cnn3"]
    assert (line["seeds"], line["seeds_at_target"]) == (2, 1)
    assert line["test_accuracy_at_target"] == 0.4
    assert (line["training_time_s"], line["training_time_over_hdc"]) == (None, None)


def test_a_disturbed_row_is_marked(table, write_run):
    why = "others took 9% of the processor time"
    busy, quiet = {"load.disturbed": why}, {"load.disturbed": ""}
    write_run("hdc", curve=[{"training_s": 0.04}], **quiet)
    for seed in (0, 1):
        beside = {"beside.hdc_s": 0.04, "seed": seed}
        load = busy if seed else quiet
        write_run("softmax_dual", curve=[{"training_s": 0.01}], **load, **beside)
    found = table()
    assert found["softmax_dual"][1][0] == "0.010 (disturbed: 1 of 2 seeds)"
    assert "disturbed" not in found["hdc"][1][0]
