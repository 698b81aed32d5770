"""Table I and verdicts are those which independent scripts compute from the records."""

import csv
import re

import pytest

from experiments.records.files import REFERENCE
from experiments.studies.table1.view import STUDY
from tests.experiments import recompute_claims, recompute_table1
from tests.experiments.recompute_table1 import disagreements


def test_the_committed_table_is_that_of_the_committed_records():
    assert list(disagreements(REFERENCE)) == []


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """The committed records, and verdicts of which one word and one number are others."""
    folder = tmp_path_factory.mktemp("changed")
    (folder / "tables").mkdir()
    (folder / "records.jsonl").symlink_to(REFERENCE / "records.jsonl")
    with (REFERENCE / "tables" / "verdicts.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        if (row["claim"], row["size"], row["status"]) == ("accuracy", "5", "all"):
            row |= {"word": "open", "equal": float(row["equal"]) + 0.01}
    with (folder / "tables" / "verdicts.csv").open("w", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return folder


def test_verdicts_are_those_of_the_records_and_a_changed_one_is_named(changed):
    number, word = recompute_claims.disagreements(changed)
    assert number.startswith("accuracy, 5, all, equal: ")
    assert word == "accuracy, 5, all: open, recomputed no"


@pytest.mark.parametrize("script", [recompute_table1, recompute_claims])
def test_a_script_shares_nothing_with_the_harness(script):
    with open(script.__file__, encoding="utf-8") as file:
        found = re.findall(r"^(?:import|from) (\w+)", file.read(), re.MULTILINE)
    assert {"experiments", "hdc", "scipy"}.isdisjoint(found)
    assert "numpy" in found


@pytest.fixture
def table(tmp_path, runs_of_table1, answers):
    """The file of Table I of invented runs."""
    path = tmp_path / "tables" / "table1.csv"
    path.parent.mkdir()
    path.write_text(answers(STUDY).table("table1").csv(), encoding="utf-8")
    return path


def rows_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_script_and_the_table_agree_on_invented_runs(tmp_path, table):
    assert list(disagreements(tmp_path)) == []
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


def test_a_changed_cell_a_missing_row_and_a_missing_file_are_named(tmp_path, table):
    rows = rows_of(table)
    for model, column, value in CHANGES:
        row = next(row for row in rows if row["model"] == model)
        assert row[column] != value
        row[column] = value
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(row for row in rows if row["model"] != "cnn3")
    said = list(disagreements(tmp_path))
    assert len(said) == len(CHANGES) + 1
    for model, column, _ in CHANGES:
        assert any(line.startswith(f"{model}, {column}: ") for line in said)
    assert "cnn3: missing" in said
    for file in (table, tmp_path / "records.jsonl"):
        file.unlink()
        assert f"{file}: missing" in list(disagreements(tmp_path))
