"""Table I is that which an independent script computes from the records."""

import csv
import re
import subprocess
import sys

import numpy as np
import pytest

from experiments.records.files import REFERENCE, ROOT
from experiments.studies.table1.view import STUDY


def recompute(folder):
    """Exit status of the script and what it says."""
    words = [sys.executable, "-m", "tests.experiments.recompute_table1", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert not done.stderr
    return done.returncode, done.stdout


def test_the_committed_table_is_that_of_the_committed_records():
    status, said = recompute(REFERENCE)
    assert status == 0, said


def test_the_script_shares_nothing_with_the_harness():
    path = ROOT / "tests" / "experiments" / "recompute_table1.py"
    found = re.findall(r"^(?:import|from) (\w+)", path.read_text("utf-8"), re.MULTILINE)
    assert {"experiments", "hdc", "scipy", "tests"}.isdisjoint(found)
    assert "numpy" in found


@pytest.fixture
def table(tmp_path, write_run, answers):
    """The file of Table I of invented runs."""
    rng = np.random.default_rng(35)
    for seed in range(7):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.4 + 0.01 * seed}])
        for model in ("softmax", "softmax_dual", "cnn1", "cnn3"):
            if model.startswith("cnn") and seed > 2:
                continue
            learnt = {} if model == "softmax_dual" else {"loss": 1.0}
            reports = [(0.7, 0.5), (0.95, 0.8), (0.993, 0.9)]
            curve = [
                {"training_s": 1 + place + float(rng.uniform()), "train_accuracy": train,
                 "test_accuracy": test, **learnt}
                for place, (train, test) in enumerate(reports)
            ]  # fmt: skip
            beside = {"hdc": float(rng.uniform(0.4, 0.6)), "hdc_numpy": 2.0}
            wrong = range(seed)
            write_run(model, seed=seed, curve=curve, beside_s=beside, wrong=wrong)
    write_run("softmax", seed=0, change={"model.lr": 0.5}, wrong=range(50))
    write_run("cnn1", seed=3, environment={"exclusive": False}, wrong=range(50))
    path = tmp_path / "tables" / "table1.csv"
    path.parent.mkdir()
    path.write_text(answers(STUDY).table("table1").csv(), encoding="utf-8")
    return path


def rows_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_script_and_the_table_agree_on_invented_runs(tmp_path, table):
    status, said = recompute(tmp_path)
    assert status == 0, said
    by_model = {row["model"]: row for row in rows_of(table)}
    assert by_model["softmax"]["seeds"] == "7"
    assert by_model["cnn1"]["seeds"] == "3"  # one was timed beside other runs


# Each in the row of this model.
CHANGES = [
    ("hdc", "seeds", "8"),
    ("softmax", "training_time_s", "1.5"),
    ("softmax", "training_time_over_hdc_low", ""),
    ("softmax_dual", "test_accuracy_final_high", "0.5"),
    ("cnn1", "test_accuracy_at_papers", "0.1"),
]


def test_a_changed_cell_and_a_missing_row_are_named(tmp_path, table):
    rows = rows_of(table)
    expected = ["cnn3: missing"]
    for model, column, value in CHANGES:
        row = next(row for row in rows if row["model"] == model)
        assert row[column] != value
        row[column] = value
        expected.append(f"{model}, {column}: ")
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(row for row in rows if row["model"] != "cnn3")
    status, said = recompute(tmp_path)
    assert status == 1
    assert len(said.splitlines()) == len(expected)
    for beginning in expected:
        assert beginning in said


@pytest.mark.parametrize("name", ["records.jsonl", "tables/table1.csv"])
def test_a_missing_file_is_named(tmp_path, table, name):
    (tmp_path / name).unlink()
    status, said = recompute(tmp_path)
    assert (status, said) == (1, f"{tmp_path / name}: missing\n")
