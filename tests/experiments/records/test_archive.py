"""Runs packed into two files are the same runs, and a bad line costs itself only."""

import json
import math

import pytest

from experiments.records import archive
from experiments.records.results import Results


@pytest.fixture
def packed(tmp_path, write_run):
    """The folder of an archive of four runs; a failed one is left out."""
    write_run("hdc", wrong=(3,))
    write_run("hdc", seed=1, curve=[{"training_s": 0.1 + 0.2, "samples_seen": 400}])
    write_run("hdc", seed=2, status="failed")
    losses = [{"training_s": 1.0, "loss": 0.1}, {"training_s": 2.0, "loss": math.inf}]
    write_run("softmax", curve=losses)
    only = [{"training_s": 1.0, "loss": math.nan}]  # has no finite loss, and is iterative even so
    write_run("softmax", seed=1, curve=only)
    assert archive.pack(tmp_path / "runs", tmp_path / "archive") == 4
    return tmp_path / "archive"


def seen(folder):
    found = Results(folder)
    assert found.problems == []
    return {run.record.id: (run.record, repr(run.curve), run.iterative) for run in found.runs}


def test_an_archive_gives_the_same_runs(tmp_path, packed):
    (tmp_path / "runs" / "another").mkdir()
    assert sorted(path.name for path in packed.iterdir()) == ["code.json", "runs.jsonl"]
    assert len((packed / "runs.jsonl").read_text().splitlines()) == 4
    assert len(json.loads((packed / "code.json").read_text())) == 2  # of HDC and of softmax
    assert seen(packed) == seen(tmp_path)


def test_packing_twice_changes_no_byte(tmp_path, packed):
    before = {path.name: path.read_bytes() for path in packed.iterdir()}
    archive.pack(tmp_path / "runs", packed)
    assert {path.name: path.read_bytes() for path in packed.iterdir()} == before


def edited(line, **changes):
    return json.dumps(json.loads(line) | changes)


BAD_LINES = {
    "no JSON": lambda line: line[:-1],
    "no mapping": lambda line: "[1]",
    "deep": lambda line: "[" * 100_000,
    "no curve": lambda line: edited(line, curve=None),
    "a curve of other columns": lambda line: edited(line, curve={"columns": [], "rows": [[1]]}),
    "a curve without times": lambda line: edited(line, curve={"columns": ["x"], "rows": [[1]]}),
    "an empty curve": lambda line: edited(line, curve={"columns": [], "rows": []}),
    "no environment": lambda line: edited(line, environment={"code": []}),
    "unknown code": lambda line: edited(line, environment={"code": "0" * 64}),
    "no result": lambda line: edited(line, n_test=-1),
    "of another schema": lambda line: edited(line, schema=2),
}


@pytest.mark.parametrize("bad", BAD_LINES)
def test_a_bad_line_costs_itself_only(packed, bad):
    path = packed / "runs.jsonl"
    first, *rest = path.read_text().splitlines()
    path.write_text("\n".join([BAD_LINES[bad](first), *rest]) + "\n")
    found = Results(packed)
    assert len(found.runs) == 3
    (problem,) = found.problems
    assert "runs.jsonl, line 1" in problem or json.loads(first)["id"] in problem


def test_an_archive_without_its_code_is_named_once(packed):
    (packed / "code.json").write_text("{")
    found = Results(packed)
    assert found.runs == []
    (problem,) = found.problems
    assert "expected an archive of runs" in problem


def test_a_file_that_is_no_record_is_not_packed(tmp_path, packed):
    path = next((tmp_path / "runs").glob("*/record.json"))
    path.write_text("{}")
    with pytest.raises(ValueError, match=r"record\.json: expected a record"):
        archive.pack(tmp_path / "runs", tmp_path / "again")
    assert not (tmp_path / "again").exists()
