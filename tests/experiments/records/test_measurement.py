"""Measurements: typed rows, found again by config and code, never lost to a later failure."""

import io
import json
import time

import msgspec
import numpy as np
import pytest
import torch
from rich.console import Console

import experiments
from experiments.protocol.experiment import Run, experiment
from experiments.records import locks, record, store
from experiments.records.environment import environment
from experiments.records.rows import Rows


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


CALLS = []


@experiment
def powers(run: Run, base: int, most: int = 3, fail_at: int | None = None):
    """One row: an exponent."""
    CALLS.append(base)
    for k in range(most):
        if k == fail_at:
            raise ValueError("no more")
        yield {
            "n": k,
            "value": np.float64(base**k),
            "label": "None",
            "odd": bool(k % 2),
        }


@pytest.fixture(autouse=True)
def no_calls():
    CALLS.clear()


def test_rows_keep_their_types(results):
    made = powers(base=2, force=False)
    assert store.find(results, made.id) == made
    assert made.rows.dicts()[1] == {"n": 1, "value": 2.0, "label": "None", "odd": True}
    assert made.frame["n"].tolist() == [0, 1, 2]
    assert made.frame["label"].tolist() == ["None"] * 3
    assert made.config == {"base": 2, "most": 3, "fail_at": None}


def test_a_failure_leaves_what_was_finished(results):
    made, before = powers(base=2), (results / store.FILE).read_bytes()

    def broken():
        yield {"n": 0}
        raise OSError("the disk is full")

    config = {"_target_": "a_test", "base": 2, "most": 3, "fail_at": None}
    with pytest.raises(OSError, match="the disk is full"):
        Run("powers", config, force=True).measure(broken, {})
    assert (results / store.FILE).read_bytes() == before
    assert store.find(results, made.id) == made


def test_finished_parts_are_not_computed_again(results):
    computed = []

    def rows(run, stop):
        for seed in range(4):
            if seed == stop:
                raise KeyboardInterrupt
            yield from run.part({"seed": seed}, lambda seed=seed: computed.append(seed) or [
                {"seed": seed}
            ])  # fmt: skip

    run = Run("sums", {"_target_": "experiments.protocol.trial", "a": 1})
    with pytest.raises(KeyboardInterrupt):
        list(rows(run, 2))
    assert list(rows(run, None)) == [{"seed": seed} for seed in range(4)]
    assert computed == [0, 1, 2, 3]


def test_numbers_that_json_lacks_become_null():
    rows = Rows.of([{"a": np.nan, "b": np.inf, "c": np.int64(3)}, {"c": [1]}])
    assert rows.dicts() == [
        {"a": None, "b": None, "c": 3},
        {"a": None, "b": None, "c": [1]},
    ]
    with pytest.raises(TypeError, match="expected plain values, found object"):
        Rows.of([{"a": object()}])


def test_a_full_disk_leaves_the_records_that_there_were(results, full_disk):
    first = powers(base=2)
    for k in range(100):
        failed = full_disk(k, lambda: powers(base=2, force=True))
        assert store.find(results, first.id).rows == first.rows
        if failed is None:
            break
        assert "No space left" in str(failed)
    assert 0 < k < 100


# What is left of a call --------------------------------------------------------------------------


def sums(changed=None, **keywords):
    """A measurement of one row that takes a hundredth of a second, and what was said."""
    console = Console(record=True, width=300, file=io.StringIO())

    def rows():
        CALLS.append("sums")
        time.sleep(0.01)
        yield {"k": 1}

    config = {"_target_": "experiments.protocol.trial", "n": 3}
    run = Run("sums", config, console=console, **keywords)
    return run.measure(rows, changed or {}), console.export_text()


def held(results):
    """The last line of the records, decoded."""
    return json.loads((results / store.FILE).read_text().splitlines()[-1])


def test_a_record_says_what_was_measured_how_and_on_what(results, monkeypatch):
    monkeypatch.setattr("sys.argv", ["run.py", "experiment=sums", "a=[1, 2]"])
    monkeypatch.setenv(record.STEP, "full/sums")
    made, said = sums(scene_name="touch", data="d" * 64, changed={"n": "3"})
    line = held(results)
    here = environment("cpu", torch.get_num_threads())
    assert 0.01 <= line["seconds"] < 60
    assert line == {
        "type": "measurement",
        "schema": 5,
        "id": made.id,
        "name": "sums",
        "steps": ["full/sums"],
        "task": "experiments.protocol.trial",
        "scene": "touch",
        "config": {"n": 3},
        "data": "d" * 64,
        "revisions": {
            "experiments.protocol.trial": 1,
            "experiments": experiments.REVISION,
        },
        "changed": {"n": "3"},
        "command": "python -m experiments.run experiment=sums 'a=[1, 2]'",
        "environment": msgspec.to_builtins(here),
        "rows": {"columns": ["k"], "values": [[1]]},
        "seconds": line["seconds"],
    }
    assert said == f"sums: 1 rows in {line['seconds']:.1f} s, {made.id}\n"
    assert made.full_config == {"_target_": "experiments.protocol.trial", "n": 3}


def test_made_or_found_a_measurement_belongs_to_the_step(results, monkeypatch):
    for step in ("quick/sums", "quick/sums", "full/sums"):
        monkeypatch.setenv(record.STEP, step)
        made, _ = sums()
    assert made.steps == store.find(results, made.id).steps
    assert made.steps == ["quick/sums", "full/sums"]
    assert CALLS == ["sums"]


@pytest.mark.parametrize(
    ("changed", "other"),
    [
        ({}, False),
        ({"scene.n": "3", "models.a": "1"}, True),
        ({"models.a": "1", "old_split.kind": '"ordered"'}, True),
        ({"split": "null"}, True),
        ({"models.scene": "1", "seeds": "[0]", "splits.n": "2"}, False),
    ],
)
def test_other_frames_are_another_scene_or_split(results, changed, other):
    assert sums(changed=changed)[0].of_other_frames is other


def test_ids_of_measurements_are_those_of_older_versions(results):
    """Under another name, everything would be measured again."""
    made = {
        "cpu": sums()[0],
        "cpu, other frames": sums(data="d")[0],
        "gpu": sums(device="meta")[0],
    }
    assert {key: one.id for key, one in made.items()} == {
        "cpu": "sums-7a058503b4cb",
        "cpu, other frames": "sums-fc1f35efa979",
        "gpu": "sums-ca3bbc4624c7",
    }
    assert made["gpu"].environment.device == "meta"
    assert "device" not in made["gpu"].config


def test_a_measurement_of_today_is_found_and_one_of_other_code_made_again(results):
    made, _ = sums()
    found = "sums: finished before (force=true runs it again)"
    assert sums() == (made, f"{found}\n")
    here = made.environment.packages
    made.environment.packages = {**here, "torch": "1.0", "numpy": "1.1", "scipy": "1.2"}
    store.append(results, made)
    versions = f"torch 1.0 (here {here['torch']}), numpy 1.1 (here {here['numpy']})"
    assert sums() == (made, f"{found}, by {versions}\n")
    assert CALLS == ["sums"]
    now = made.revisions
    made.revisions = dict.fromkeys(now, 0)
    store.append(results, made)
    again, said = sums()
    first, second = said.splitlines()
    assert first.startswith(f"{made.id}: made again, finished otherwise: ")
    for name, number in now.items():
        assert f"{name} (revision 0, now {number})" in first
    assert second.startswith("sums: 1 rows in ")
    assert CALLS == ["sums"] * 2
    assert store.find(results, made.id) == again


def test_a_measurement_that_another_process_is_at_is_left_to_it(results):
    made, _ = sums()
    with (
        locks.held(store.lock_of(results, made.id)),
        pytest.raises(locks.Held, match="sums"),
    ):
        sums(force=True)
    assert CALLS == ["sums"]


def test_a_damaged_part_and_one_of_other_code_are_computed_again(results, monkeypatch):
    calls = []

    def rows():
        """Of the part, as a list of one row: which computation made it."""
        calls.append(0)
        return [{"call": len(calls)}]

    def part():
        config = {"_target_": "experiments.protocol.trial"}
        return list(Run("sums", config).part({"n": 1}, rows))

    assert part() == part() == [{"call": 1}]
    path = results / "cache" / "parts" / store.FILE
    path.write_bytes(path.read_bytes()[:-20])
    assert part() == part() == [{"call": 2}]
    now = f'"experiments":{experiments.REVISION}'
    text = path.read_text().replace(now, '"experiments":0')
    path.write_text(text)
    assert part() == part() == [{"call": 3}]
