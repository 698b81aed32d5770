"""Records are named after what determines them, and whole on disk or absent."""

import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from experiments import record, sources

CHECKOUT = Path(__file__).resolve().parents[2]


def test_equal_configs_have_one_id_whatever_their_order():
    a = record.run_id("touch", "hdc", {"seed": {"run": 0, "init": 1}, "device": "cpu"}, "f00d")
    b = record.run_id("touch", "hdc", {"device": "cpu", "seed": {"init": 1, "run": 0}}, "f00d")
    assert a == b
    assert a.startswith("touch-hdc-")


leaves = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text())
configs = st.dictionaries(st.text(), leaves, max_size=4)


@given(configs, configs)
def test_ids_differ_exactly_when_configs_do(a, b):
    same = json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)  # 1, 1.0, true differ
    assert (record.run_id("s", "m", a, "f") == record.run_id("s", "m", b, "f")) == same


def test_other_data_other_id():
    assert record.run_id("s", "m", {}, "f") != record.run_id("s", "m", {}, "g")


def test_a_record_comes_back_with_plain_values(tmp_path):
    entry = {
        "schema": record.SCHEMA,
        "status": "finished",
        "array": np.arange(3),
        "tensor": torch.tensor([[1, 2]]),
        "scalar": np.float32(0.5),
        "nan": math.nan,
        "inside": [{"infinite": (math.inf, np.float64("nan"), 1.5)}],
        3: "key",
        "name": "≤ 0 µm",
    }
    record.write_record(tmp_path / "run", entry)
    assert record.read_record(tmp_path / "run") == {
        "schema": record.SCHEMA,
        "status": "finished",
        "array": [0, 1, 2],
        "tensor": [[1, 2]],
        "scalar": 0.5,
        "nan": None,
        "inside": [{"infinite": [None, None, 1.5]}],
        "3": "key",
        "name": "≤ 0 µm",
    }


def test_no_record_is_none(tmp_path):
    assert record.read_record(tmp_path / "nowhere") is None


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b'{"schema": record.SCHEMA, "status": "fini',
        b"\xff\xfe\x00",
        b"[1, 2]",
        b"null",
        b'{"status": "finished"}',
        b'{"schema": 99, "status": "finished"}',
        b'{"schema": record.SCHEMA}',
        b'{"schema": record.SCHEMA, "status": "done"}',
        b"[" * 100_000,
        b"9" * 10_000,
    ],
    ids=repr,
)
def test_a_file_that_is_no_record_is_named(tmp_path, content):
    path = tmp_path / "record.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="expected") as caught:
        record.read_record(tmp_path)
    assert str(path) in str(caught.value)


@given(st.binary(max_size=200))
def test_random_bytes_give_the_named_error(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "record.json")
        path.write_bytes(content)
        with pytest.raises(ValueError, match="expected"):
            record.read_record(Path(folder))


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, call):
    path = tmp_path / "record.json"
    record.write_atomically(path, "old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(record.os, call, full)
    with pytest.raises(OSError, match="No space"):
        record.write_atomically(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_text_is_on_disk_before_it_has_the_name(tmp_path, monkeypatch):
    steps = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(record.os, "fsync", lambda h: (steps.append("fsync"), fsync(h)))
    monkeypatch.setattr(record.os, "replace", lambda a, b: (steps.append("name"), replace(a, b)))
    record.write_atomically(tmp_path / "deep" / "file", "µ\n")
    assert steps == ["fsync", "name"]
    assert (tmp_path / "deep" / "file").read_bytes() == "µ\n".encode()
    assert (tmp_path / "deep" / "file").stat().st_mode & 0o777 == 0o644


def test_the_curve_has_a_column_for_every_key_and_full_precision(tmp_path):
    rows = [
        {"training_s": 0.1 + 0.2, "samples_seen": np.int64(64), "train_accuracy": np.float64(0.5)},
        {"training_s": 1.0, "samples_seen": 128, "loss": math.nan},
        {"training_s": torch.tensor(2.0), "loss": math.inf},
    ]
    record.write_curve(tmp_path, rows)
    with (tmp_path / "curve.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert list(read[0]) == ["training_s", "samples_seen", "train_accuracy", "loss"]
    assert float(read[0]["training_s"]) == 0.1 + 0.2
    assert [list(row.values()) for row in read] == [
        ["0.30000000000000004", "64", "0.5", ""],
        ["1.0", "128", "", "nan"],
        ["2.0", "", "", "inf"],
    ]


def test_the_environment_says_what_a_reader_of_a_time_wants_to_know():
    environment = record.environment("cpu", 3, {})
    assert environment["threads"] == 3
    assert environment["device"] == "cpu"
    assert environment["cores"] == os.cpu_count()
    assert environment["cpu"]
    assert environment["python"] == ".".join(map(str, sys.version_info[:3]))
    assert environment["packages"]["torch"].split("+")[0] == torch.__version__.split("+")[0]
    assert environment["packages"]["numpy"] == np.__version__
    assert len(environment["code"]) == 64
    assert json.dumps(environment)


def git(folder, *words):
    who = ["-c", "user.name=t", "-c", "user.email=t@t"]
    done = subprocess.run(
        ["git", "-C", str(folder), *who, *words], check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


HDC = {"model": {"_target_": "hdc.bits.Nothing"}}


def forget():
    """What was read of a checkout."""
    for cached in (
        record._git, sources.digest, sources._closure, sources._imports, sources._now
    ):  # fmt: skip
        cached.cache_clear()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A small checkout in the place of this one."""
    (tmp_path / "hdc").mkdir()
    (tmp_path / "hdc" / "bits.py").write_text("a = 1\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    for module in (record, sources):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    forget()
    yield tmp_path
    forget()


def manifest():
    forget()
    return record.environment("cpu", 1, HDC)


def test_commit_and_dirt_and_code_hash(checkout):
    clean = manifest()
    assert clean["commit"] == git(checkout, "rev-parse", "HEAD")
    assert clean["dirty"] is False
    (checkout / "results").mkdir()
    (checkout / "results" / "record.json").write_text("{}")
    assert manifest() == clean  # results are not code
    (checkout / "hdc" / "bits.py").write_text("a = 2\n")
    changed = manifest()
    assert changed["dirty"] is True
    assert changed["commit"] == clean["commit"]
    assert changed["code"] != clean["code"]


def test_without_git_the_code_hash_remains(tmp_path, monkeypatch, checkout):
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    environment = manifest()
    assert environment["commit"] is None
    assert environment["dirty"] is None
    assert len(environment["code"]) == 64


def test_results_lie_in_the_checkout_or_where_the_variable_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RESULTS_DIR", raising=False)
    assert record.results_dir() == CHECKOUT / "results"
    monkeypatch.setenv("RESULTS_DIR", "")
    assert record.results_dir() == CHECKOUT / "results"
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "elsewhere"))
    assert record.results_dir() == tmp_path / "elsewhere"


def test_the_command_can_be_typed_again(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["run.py", "scene.path=my frames", "seed.run=0,1"])
    assert record.command() == "python -m experiments.run 'scene.path=my frames' seed.run=0,1"
