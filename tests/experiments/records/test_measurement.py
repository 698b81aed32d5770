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
from experiments.protocol.experiment import Run
from experiments.records import locks, store
from experiments.records.environment import environment
from experiments.records.rows import Rows

CONFIG = {"_target_": "experiments.protocol.trial", "n": 3}
CALLS = []


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    CALLS.clear()
    return tmp_path


def sums(changed=None, **keywords):
    """A measurement of one row that takes a hundredth of a second, and what was said."""
    console = Console(record=True, width=300, file=io.StringIO())

    def rows():
        CALLS.append("sums")
        time.sleep(0.01)
        yield {"k": np.int64(1), "of": "None", "odd": True, "value": np.nan}

    run = Run("sums", CONFIG, console=console, **keywords)
    return run.measure(rows, changed or {}), console.export_text()


def test_a_record_says_what_was_measured_how_and_on_what(results, monkeypatch):
    monkeypatch.setattr("sys.argv", ["run.py", "experiment=sums", "a=[1, 2]"])
    made, said = sums(scene_name="touch", data="d" * 64, changed={"n": "3"})
    line = json.loads((results / store.FILE).read_text().splitlines()[-1])
    assert 0.01 <= line["seconds"] < 60
    assert line == {
        "type": "measurement",
        "schema": 5,
        "id": made.id,
        "name": "sums",
        "task": "experiments.protocol.trial",
        "scene": "touch",
        "config": {"n": 3},
        "data": "d" * 64,
        "revisions": {CONFIG["_target_"]: 1, "experiments": experiments.REVISION},
        "changed": {"n": "3"},
        "command": "python -m experiments.run experiment=sums 'a=[1, 2]'",
        "environment": msgspec.to_builtins(environment("cpu", torch.get_num_threads())),
        "rows": {
            "columns": ["k", "of", "odd", "value"],
            "values": [[1, "None", True, None]],  # JSON has no NaN
        },
        "seconds": line["seconds"],
    }
    assert said == f"sums: 1 rows in {line['seconds']:.1f} s, {made.id}\n"
    assert store.find(results, made.id) == made
    with pytest.raises(TypeError, match="expected plain values, found object"):
        Rows.of([{"a": object()}])


def test_a_full_disk_leaves_the_records_that_there_were(results, full_disk):
    first, _ = sums()
    for k in range(100):
        failed = full_disk(k, lambda: sums(force=True))
        assert store.find(results, first.id).rows == first.rows
        if failed is None:
            break
        assert "No space left" in str(failed)
    assert 0 < k < 100


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
def test_other_frames_are_another_scene_or_split(changed, other):
    assert sums(changed=changed)[0].of_other_frames is other


@pytest.mark.parametrize(
    ("keywords", "name"),
    [
        ({}, "sums-7a058503b4cb"),
        ({"data": "d"}, "sums-fc1f35efa979"),
        ({"device": "meta"}, "sums-ca3bbc4624c7"),
    ],
)
def test_ids_of_measurements_are_those_of_older_versions(keywords, name):
    """Under another name, everything would be measured again."""
    made, _ = sums(**keywords)
    assert made.id == name
    assert made.environment.device == keywords.get("device", "cpu")
    assert "device" not in made.config


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
    held = locks.held(store.lock_of(results, made.id))
    with held, pytest.raises(locks.Held, match="sums"):
        sums(force=True)
    assert CALLS == ["sums"]


def test_a_part_is_computed_once_and_again_if_it_is_damaged_or_of_other_code(results):
    def part(n=1):
        """The part, a list of one row: which computation made it."""

        def rows():
            CALLS.append(n)
            return [{"call": len(CALLS)}]

        return list(Run("sums", CONFIG).part({"n": n}, rows))

    assert part() == part() == [{"call": 1}]
    path = results / "cache" / "parts" / store.FILE
    path.write_bytes(path.read_bytes()[:-20])
    assert part() == part() == [{"call": 2}]
    now = f'"experiments":{experiments.REVISION}'
    path.write_text(path.read_text().replace(now, '"experiments":0'))
    assert part() == part() == [{"call": 3}]
    assert part(2) == [{"call": 4}]
