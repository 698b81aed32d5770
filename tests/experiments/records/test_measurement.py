"""Measurements: typed rows, found again by config and code, never lost to a later failure."""

import io
import json
import re
import sys
import time

import numpy as np
import pytest
import torch
from rich.console import Console

from experiments.protocol.experiment import Run, experiment
from experiments.records import locks, measurement, steps
from experiments.records.environment import environment


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


def read(path):
    return measurement.read(path)


def test_rows_keep_their_types(results):
    measured = read(powers(base=2, force=False))
    assert measured.rows[1] == {"n": 1, "value": 2.0, "label": "None", "odd": True}
    assert measured.frame["n"].tolist() == [0, 1, 2]
    assert measured.frame["label"].tolist() == ["None"] * 3
    assert measured.record.config == {"base": 2, "most": 3, "fail_at": None}
    assert measured.record.status == "finished"


def test_a_measurement_is_made_once_unless_forced(results):
    for force in (False, False, True):
        powers(base=2, force=force)
    assert CALLS == [2, 2]
    assert powers(base=3) != powers(base=2)


def test_a_failure_leaves_what_was_finished(results, monkeypatch):
    path = powers(base=2)
    rows = (path / "rows.jsonl").read_bytes()

    def broken(run, **_):
        yield {"n": 0}
        raise OSError("the disk is full")

    monkeypatch.setattr(measurement, "write", lambda *_: pytest.fail("written"))
    with pytest.raises(OSError, match="the disk is full"):
        measurement.measure(
            "powers",
            {"_target_": "a_test", "base": 2, "most": 3, "fail_at": None},
            lambda: broken(None),
            force=True,
        )
    assert (path / "rows.jsonl").read_bytes() == rows
    assert read(path).record.status == "finished"


@pytest.mark.parametrize("arguments", [{}, {"base": 2, "mots": 3}])
def test_a_wrong_key_is_named(results, arguments):
    with pytest.raises(ValueError, match="expected the keys base, most, fail_at"):
        powers(**arguments)


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
    text = measurement.to_lines(
        [{"a": float("nan"), "b": float("inf"), "c": np.int64(3)}]
    )
    assert measurement.from_lines(text) == [{"a": None, "b": None, "c": 3}]


def test_whatever_step_of_a_write_fails_no_record_vouches_for_rows_of_another_call(
    results, full_disk
):
    folder = powers(base=2, force=False)
    entry = json.loads((folder / "record.json").read_text())
    measurement.write(folder, {**entry, "seconds": -1}, [{"n": -1}])
    for k in range(100):
        again = {**entry, "seconds": k}
        failed = full_disk(
            k, lambda again=again, k=k: measurement.write(folder, again, [{"n": k}])
        )
        if (found := read(folder)) is not None:
            assert found.rows == (
                [{"n": k}] if found.record.seconds == k else [{"n": k - 1}]
            )
        if failed is None:
            break
        assert "No space left" in str(failed)
        measurement.write(folder, again, [{"n": k}])
    assert (
        k == 11
    )  # the old record; folder, file, flush, name and temporary file of both


# What is left of a call --------------------------------------------------------------------------


def sums(**keywords):
    """measure() of one row that takes a hundredth of a second → its folder, and what it said."""
    console = Console(record=True, width=300, file=io.StringIO())

    def rows():
        CALLS.append("sums")
        time.sleep(0.01)
        yield {"k": 1}

    config = {"_target_": "experiments.protocol.trial", "n": 3}
    folder = measurement.measure("sums", config, rows, console=console, **keywords)
    return folder, console.export_text()


def test_a_record_says_what_was_measured_how_and_on_what(results, monkeypatch):
    monkeypatch.setattr("sys.argv", ["run.py", "experiment=sums", "a=[1, 2]"])
    folder, said = sums(scene="touch", data="d" * 64, changed={"n": "3"})
    held = json.loads((folder / "record.json").read_text())
    assert 0.01 <= held["seconds"] < 60
    assert held == {
        "schema": 4,
        "id": folder.name,
        "name": "sums",
        "status": "finished",
        "task": "experiments.protocol.trial",
        "scene": "touch",
        "config": {"n": 3},
        "data": "d" * 64,
        "revisions": {"experiments.protocol.trial": 1, "experiments": 1},
        "changed": {"n": "3"},
        "command": "python -m experiments.run experiment=sums 'a=[1, 2]'",
        "environment": environment("cpu", torch.get_num_threads()),
        "seconds": held["seconds"],
    }
    assert said == f"sums: 1 rows in {held['seconds']:.1f} s, {folder}\n"
    assert read(folder).folder == folder
    assert read(folder).record.full_config == {
        "_target_": "experiments.protocol.trial",
        "n": 3,
    }


def test_made_or_found_a_measurement_is_in_the_list_of_its_step(results, monkeypatch):
    path = steps.place(results, "full", "sums")
    for _ in range(2):
        monkeypatch.setenv(steps.VARIABLE, str(steps.begin(path)))
        folder, _ = sums()
        (listed,) = steps.read(results)
        assert listed.names == {folder.name}
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
    assert read(sums(changed=changed)[0]).of_other_frames is other


def test_what_computes_without_torch_has_one_thread(results, monkeypatch):
    monkeypatch.setattr(torch, "get_num_threads", lambda: 7)
    assert read(sums()[0]).record.environment.threads == 7
    monkeypatch.setitem(sys.modules, "torch", None)
    assert read(sums(force=True)[0]).record.environment.threads == 1


def test_places_of_measurements_are_those_of_older_versions(results):
    """Under another name, everything would be measured again."""
    names = {
        "cpu": sums()[0],
        "cpu, other frames": sums(data="d")[0],
        "gpu": sums(device="meta")[0],
    }
    assert {key: str(path.relative_to(results)) for key, path in names.items()} == {
        "cpu": "measured/sums-7a058503b4cb",
        "cpu, other frames": "measured/sums-fc1f35efa979",
        "gpu": "measured/sums-ca3bbc4624c7",
    }
    assert read(names["gpu"]).record.environment.device == "meta"
    assert "device" not in read(names["gpu"]).record.config


def test_a_measurement_of_today_is_found_and_one_of_other_code_made_again(results):
    folder, _ = sums()
    found = "sums: finished before (force=true runs it again)"
    assert sums() == (folder, f"{found}\n")
    path = folder / "record.json"
    entry = json.loads(path.read_text())
    here = entry["environment"]["packages"]
    other = {**here, "torch": "1.0", "numpy": "1.1", "scipy": "1.2"}
    environment = {**entry["environment"], "packages": other}
    measurement.write(folder, {**entry, "environment": environment}, [{"k": 2}])
    versions = f"torch 1.0 (here {here['torch']}), numpy 1.1 (here {here['numpy']})"
    assert sums() == (folder, f"{found}, by {versions}\n")
    assert CALLS == ["sums"]
    old = {"experiments": 0, "experiments.protocol.trial": 0}
    measurement.write(folder, {**entry, "revisions": old}, [{"k": 2}])
    _, said = sums()
    first, second = said.splitlines()
    assert first.startswith("sums: measured again: ")
    for name in old:
        assert f"{name} (revision 0, now 1)" in first
    assert second.startswith("sums: 1 rows in ")
    measurement.write(folder, {**entry, "status": "failed"}, [])
    sums()
    assert CALLS == ["sums"] * 3
    assert read(folder).rows == [{"k": 1}]


def test_a_measurement_that_another_process_is_at_is_left_to_it(results):
    folder, _ = sums()
    with (
        locks.held(folder / locks.FILE),
        pytest.raises(locks.Held, match=folder.name),
    ):
        sums(force=True)
    assert CALLS == ["sums"]


def test_a_record_has_a_line_a_key_and_arrays_as_lists(results):
    entry = {"b": {"x": np.arange(2)}, "a": np.int64(3), "c": torch.zeros(1)}
    measurement.write(results / "m", entry, [{"k": np.arange(2)}, {"k": 1.5}])
    assert (results / "m" / "record.json").read_text() == (
        '{\n"a": 3,\n"b": {"x":[0,1]},\n"c": [0.0]\n}\n'
    )
    assert (results / "m" / "rows.jsonl").read_text() == '{"k":[0,1]}\n{"k":1.5}\n'
    with pytest.raises(TypeError, match="expected plain values, found object"):
        measurement.write(results / "m", {"a": object()}, [])


def test_a_damaged_measurement_is_named_and_one_that_is_not_there_is_none(results):
    folder = powers(base=2)
    assert read(folder.parent) is None
    for text in ("[1]\n", "7\n", '{"k": 1}\n{"k": \n'):
        (folder / "rows.jsonl").write_text(text)
        with pytest.raises(ValueError, match=re.escape(f"{folder / 'rows.jsonl'}: ")):
            read(folder)
    (folder / "rows.jsonl").unlink()
    assert read(folder).rows == []
    (folder / "record.json").write_text('{"schema": 3}')
    with pytest.raises(ValueError, match=re.escape(f"{folder / 'record.json'}: ")):
        read(folder)


def test_a_damaged_part_and_one_of_other_code_are_computed_again(results, monkeypatch):
    calls = []

    def rows():
        """Of the part, as a list of one row: which computation made it."""
        calls.append(0)
        return [{"call": len(calls)}]

    def part():
        config = {"_target_": "experiments.protocol.trial"}
        return measurement.part("sums", config, rows)

    assert part() == part() == [{"call": 1}]
    (path,) = (results / "cache" / "parts").iterdir()
    assert re.fullmatch(r"sums-[0-9a-f]{12}\.jsonl", path.name)
    path.write_text('{"call": ')
    assert part() == part() == [{"call": 2}]
    monkeypatch.setattr(measurement, "changes", lambda: "a" * 12)
    assert part() == part() == [{"call": 3}]
    monkeypatch.setattr(
        measurement, "revisions", lambda config: {config["_target_"]: 99}
    )
    assert part() == part() == [{"call": 4}]
