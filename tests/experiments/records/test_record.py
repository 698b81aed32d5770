"""Records of runs: what is written is read again, whatever a kill leaves between the lines."""

import json
import math

import pytest

import experiments
from experiments.records import record, store
from experiments.records.rows import pack_labels
from experiments.records.run import Finished


def lines(folder):
    return (folder / store.FILE).read_bytes().splitlines(keepends=True)


def test_a_run_is_read_as_it_was_written(tmp_path, write_run):
    curve = [
        {"training_s": 1.0, "loss": math.inf},
        {"training_s": 2.0, "loss": 0.1, "epoch": 1.0},
    ]
    name = write_run("softmax", seed=3, wrong=range(7), curve=curve)
    (run,) = store.read(tmp_path)
    assert (run.id, run.seed, run.status) == (name, 3, "finished")
    assert run.right.sum() == 93
    assert run.revisions["experiments"] == experiments.REVISION
    first, second = run.curve
    assert first["loss"] == math.inf
    assert "epoch" not in first
    assert second["epoch"] == 1.0
    assert store.find(tmp_path, name) == run
    assert store.find(tmp_path, "touch-hdc-000000000000") is None


def test_of_several_lines_the_last_finished_one_counts(tmp_path, write_run):
    write_run("hdc", status="failed")
    write_run("hdc", wrong=[1])
    write_run("hdc", wrong=[1, 2])
    name = write_run("hdc", status="interrupted")
    (run,) = store.read(tmp_path)
    assert (run.id, run.status, run.right.sum()) == (name, "finished", 98)


@pytest.mark.parametrize("left", [1, 100, -2])
def test_a_line_that_a_kill_cut_short_costs_itself_only(tmp_path, write_run, left):
    write_run("hdc", seed=0)
    write_run("hdc", seed=1)
    first, second = lines(tmp_path)
    (tmp_path / store.FILE).write_bytes(first + second[:left])
    write_run("hdc", seed=2)
    runs = list(store.read(tmp_path))
    assert [run.seed for run in runs if isinstance(run, Finished)] == [0, 2]
    (error,) = (run for run in runs if isinstance(run, ValueError))
    assert f"{tmp_path / store.FILE}, line 2" in str(error)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"schema": 3}, "schema"),
        ({"training_s": "soon"}, "training_s"),
        ({"config": 7}, "config"),
        ({"config": {}}, "config.scene: expected a mapping, found None"),
        ({"predicted": pack_labels([0])}, "predicted: expected 100 labels, found 1"),
        (
            {"predicted": pack_labels([5] * 100)},
            "predicted: expected labels from 0 to 4, found 5 to 5",
        ),
        ({"test_labels": [1, 2]}, "expected packed labels, found [1, 2]"),
        ({"predicted": "u1:AAAA"}, "labels: expected packed integers"),
        ({"rows": {"columns": ["a"], "values": [[1, 2]]}}, "rows: expected 1 values"),
        ({"rows": {"columns": ["a"], "values": [["x"]]}}, "curve: expected numbers"),
        (
            {"test_accuracy_final": 0.9},
            "test_accuracy_final: expected 1.000000 of the predictions beside it, found 0.9",
        ),
    ],
)
def test_a_malformed_record_is_named_with_its_key_and_skipped(
    tmp_path, write_run, change, expected
):
    write_run("hdc")
    (line,) = lines(tmp_path)
    (tmp_path / store.FILE).write_text(json.dumps(json.loads(line) | change))
    (error,) = store.read(tmp_path)
    assert isinstance(error, ValueError)
    assert expected in str(error)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("seed", {"run": None}, "config.seed.run: expected an integer, found None"),
        ("split", {}, "config.split.n_train: expected a value, found none"),
        ("data", None, "config.data: expected a mapping, found None"),
    ],
)
def test_a_record_without_what_every_run_has_is_named(
    tmp_path, write_run, key, value, expected
):
    write_run("hdc")
    entry = json.loads(lines(tmp_path)[0])
    entry["config"][key] = value
    (tmp_path / store.FILE).write_text(json.dumps(entry))
    (error,) = store.read(tmp_path)
    assert expected in str(error)


def test_labels_of_a_run_are_short(tmp_path, write_run):
    name = write_run("hdc", wrong=[3], truth=[0] * 1000)
    (line,) = lines(tmp_path)
    assert len(json.loads(line)["predicted"]) < 60
    assert store.find(tmp_path, name).predicted.tolist().index(1) == 3


def test_the_name_of_a_record_depends_on_every_value_of_its_config():
    config = {"a": {"b": 1}, "c": [1, 2]}
    name = record.name_of("touch-hdc", config, "f")
    assert name == record.name_of("touch-hdc", {"c": [1, 2], "a": {"b": 1}}, "f")
    for other in ({"a": {"b": 2}, "c": [1, 2]}, {"a": {"b": 1}, "c": [2, 1]}):
        assert record.name_of("touch-hdc", other, "f") != name
    assert record.name_of("touch-hdc", config, "g") != name


def test_the_name_of_a_run_is_that_of_older_versions():
    """Under another name, every run would be carried out again."""
    name = record.name_of("touch-hdc", {"b": 1, "a": [1, None]}, "f")
    assert name == "touch-hdc-a379c5298fb1"


def test_records_are_written_as_they_were_read(tmp_path, write_run, write_measurement):
    """A reference is taken over record by record, and each call of it leaves the same bytes."""
    write_run("hdc")
    write_measurement("drift", [{"a": 1, "b": None}, {"a": 0.1, "b": "x"}])
    before = lines(tmp_path)
    store.write_all(tmp_path, list(store.read(tmp_path)))
    assert lines(tmp_path) == before
    store.write_all(tmp_path, [])
    assert lines(tmp_path) == []
