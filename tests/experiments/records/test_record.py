"""Records of runs: what is written is read again, whatever a kill leaves between the lines."""

import json
import math

import pytest

from experiments.records import record


def lines(folder):
    return (folder / record.RUNS).read_bytes().splitlines(keepends=True)


def test_a_run_is_read_as_it_was_written(tmp_path, write_run):
    curve = [
        {"training_s": 1.0, "loss": math.inf},
        {"training_s": 2.0, "loss": 0.1, "epoch": 1.0},
    ]
    name = write_run("softmax", seed=3, wrong=range(7), curve=curve)
    (run,) = record.read(tmp_path)
    assert (run.id, run.seed, run.status) == (name, 3, "finished")
    assert run.right.sum() == 93
    assert run.environment.sources
    first, second = record.curve_of(run)
    assert first["loss"] == math.inf
    assert "epoch" not in first
    assert second["epoch"] == 1.0
    assert record.find(tmp_path, name) == run
    assert record.find(tmp_path, "touch-hdc-000000000000") is None


def test_of_several_lines_the_last_finished_one_counts(tmp_path, write_run):
    write_run("hdc", status="failed")
    write_run("hdc", wrong=[1])
    write_run("hdc", wrong=[1, 2])
    name = write_run("hdc", status="interrupted")
    (run,) = record.read(tmp_path)
    assert (run.id, run.status, run.right.sum()) == (name, "finished", 98)


@pytest.mark.parametrize("left", [1, 100, -2])
def test_a_line_that_a_kill_cut_short_costs_itself_only(tmp_path, write_run, left):
    write_run("hdc", seed=0)
    write_run("hdc", seed=1)
    first, second = lines(tmp_path)
    (tmp_path / record.RUNS).write_bytes(first + second[:left])
    write_run("hdc", seed=2)
    runs = list(record.read(tmp_path))
    assert [run.seed for run in runs if isinstance(run, record.Record)] == [0, 2]
    (error,) = (run for run in runs if isinstance(run, ValueError))
    assert f"{tmp_path / record.RUNS}, line 2" in str(error)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"schema": 2}, "schema"),
        ({"training_s": "soon"}, "training_s"),
        ({"config": 7}, "config"),
    ],
)
def test_a_malformed_record_is_named_with_its_key_and_skipped(
    tmp_path, write_run, change, expected
):
    write_run("hdc")
    (line,) = lines(tmp_path)
    (tmp_path / record.RUNS).write_text(json.dumps(json.loads(line) | change))
    (error,) = record.read(tmp_path)
    assert isinstance(error, ValueError)
    assert expected in str(error)


def test_the_digests_of_code_are_stored_once(tmp_path, write_run):
    for seed in range(3):
        write_run("hdc", seed=seed)
    assert len(record.read_code(tmp_path)) == 1
    assert b"sources" not in b"".join(lines(tmp_path))


def test_the_name_of_a_run_depends_on_every_value_of_its_config():
    config = {"a": {"b": 1}, "c": [1, 2]}
    name = record.run_id("touch", "hdc", config, "f")
    assert name == record.run_id("touch", "hdc", {"c": [1, 2], "a": {"b": 1}}, "f")
    for other in ({"a": {"b": 2}, "c": [1, 2]}, {"a": {"b": 1}, "c": [2, 1]}):
        assert record.run_id("touch", "hdc", other, "f") != name
    assert record.run_id("touch", "hdc", config, "g") != name
