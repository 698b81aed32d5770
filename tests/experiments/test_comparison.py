"""Published numbers beside ours: the verdict's rule and what it is given."""

import csv
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments import comparison
from experiments.record import ROOT
from experiments.selection import Records

PUBLISHED = list(csv.DictReader((ROOT / "results" / "published.csv").open(encoding="utf-8")))


def compared(folder):
    rows = comparison.compare(Records(folder), folder)
    return {f"{row['experiment']}/{row['quantity']}": row for row in rows}


def epochs(*accuracies):
    return [{"training_s": 10.0 * k, "loss": 1.0, "train_accuracy": accuracy}
            for k, accuracy in enumerate(accuracies, 1)]  # fmt: skip


def number(published=90.0, **values):
    return {"published": published, **values}


@pytest.mark.parametrize(
    ("row", "calibration", "verdict"),
    [
        (number(), None, "missing"),
        (number(), "fitted", "missing"),
        (number(setting=True), None, "missing"),
        (number(measured=90.0, setting=True), None, "setting, same"),
        (number(measured=91.0, setting=True), None, "setting, another"),
        (number(measured="not reached in 5 s"), None, "not reached"),
        (number(measured=90.0), None, "no interval"),
        (number(measured=90.0, ci_low=80.0), None, "no interval"),
        (number(measured=90.0), "fitted", "fitted, no interval"),
        (number(measured=88.0, ci_low=85.0, ci_high=91.0), None, "matches"),
        (number(measured=88.0, ci_low=85.0, ci_high=89.0), None, "differs"),
        (number(measured=88.0, ci_low=85.0, ci_high=91.0), "fitted", "fitted"),
        (number(measured=88.0, ci_low=85.0, ci_high=89.0), "fitted", "fitted, differs"),
        (number(measured=88.0, ci_low=85.0, ci_high=91.0), "predicted", "predicted, matches"),
        # Both have an interval: √(1² + 1.5²) = 1.8.
        (number(measured=88.3, ci_low=85.0, ci_high=89.3, published_low=88.5), None, "matches"),
        (number(measured=88.1, ci_low=85.0, ci_high=89.1, published_low=88.5), None, "differs"),
        (number(measured=91.7, ci_low=90.7, ci_high=99.0, published_high=91.5), None, "matches"),
        (number(measured=91.9, ci_low=90.9, ci_high=99.0, published_high=91.5), None, "differs"),
    ],
)
def test_verdicts(row, calibration, verdict):
    assert comparison.verdict(row, calibration) == verdict


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0, 10), st.floats(0, 10))
def test_against_an_exact_number_the_interval_itself_decides(ours, paper, below, above):
    row = number(paper, measured=ours, ci_low=ours - below, ci_high=ours + above)
    inside = row["ci_low"] <= paper <= row["ci_high"]
    if not any(math.isclose(paper, row[side], rel_tol=1e-9, abs_tol=1e-9) for side in
               ("ci_low", "ci_high")):  # fmt: skip
        assert comparison.verdict(row) == ("matches" if inside else "differs")


def test_interval_of_times_in_closed_form():
    low, high = comparison.interval_of_times([1.0, 2.0, 4.0])
    half = 4.302652730 * math.log(2) / math.sqrt(3)  # Student's t with two degrees of freedom
    assert (math.log(low), math.log(high)) == pytest.approx(
        (math.log(2) - half, math.log(2) + half)
    )


@pytest.mark.parametrize("times", [[], [1.0, 1.1], [1.0, 1.1, math.inf]])
def test_no_interval_of_too_few_or_unreached_times(times):
    assert comparison.interval_of_times(times) == (None, None)


def test_every_published_line_has_a_row_whatever_is_missing(tmp_path):
    found = compared(tmp_path)
    assert list(found) == [f"{line['experiment']}/{line['quantity']}" for line in PUBLISHED]
    assert {row["verdict"] for row in found.values()} == {"missing"}
    assert all(row["made_by"].startswith("python -m experiments.run ") for row in found.values())


def test_numbers_of_table_1(tmp_path, write_run):
    for seed in (0, 1, 2):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.6 * 2**seed}], wrong=range(2))
        write_run("cnn1", seed=seed, curve=epochs(0.5, 0.8), stop="quick", wrong=range(9))
    write_run("softmax", curve=epochs(0.5, 0.95))
    found = compared(tmp_path)
    assert len(found) == len(PUBLISHED)
    row = found["table1/hdc_test_accuracy"]
    assert (row["measured"], row["n"], row["seeds"]) == (98, 300, 3)
    assert row["ci_low"] < 98 < row["ci_high"] < 100
    assert row["verdict"] == "predicted, matches"
    row = found["table1/hdc_training_time"]
    assert (row["measured"], row["n"], row["verdict"]) == (1.2, 3, "matches")
    assert row["ci_low"] < 1.24 < row["ci_high"]
    assert found["table1/softmax_training_time"]["verdict"] == "no interval"
    assert found["table1/cnn1_training_time"]["measured"] == "not reached in 20 s"
    assert found["table1/cnn1_training_time"]["verdict"] == "not reached"
    assert found["table1/cnn3_test_accuracy"]["verdict"] == "missing"
    assert found["table1/learning_rate"]["verdict"] == "setting, same"
    assert found["table1/cnn1_test_accuracy"]["made_by"] == (
        "python -m experiments.run -m scene=touch model=cnn1 stop=quick seed.run=0,1,2"
    )


def test_csv_and_markdown_have_the_same_verdicts(tmp_path, a_full_set):
    rows = comparison.compare(Records(tmp_path), tmp_path)
    read = list(csv.DictReader(comparison.to_csv(rows).splitlines()))
    assert [line["verdict"] for line in read] == [row["verdict"] for row in rows]
    lines = comparison.to_markdown(rows).splitlines()[4:]
    assert [line.split(" | ")[1] for line in lines] == [row["verdict"] for row in rows]


def test_a_command_for_all_models_with_the_same_seeds(tmp_path, write_run):
    for model, seeds in (("hdc", 2), ("softmax", 2), ("cnn1", 1)):
        for seed in range(seeds):
            write_run(model, seed=seed)
    records = Records(tmp_path)
    groups = [records.group("touch", model) for model in ("hdc", "softmax", "cnn1", "cnn3")]
    command = "python -m experiments.run -m scene=touch model={} stop=paper seed.run={}"
    assert comparison.commands(groups) == [
        command.format("hdc,softmax", "0,1"), command.format("cnn1", "0"),
    ]  # fmt: skip
    assert comparison.commands(groups[3:]) == []
