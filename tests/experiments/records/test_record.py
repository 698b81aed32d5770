"""Records are named after what determines them, come back typed, and are refused by name."""

import csv
import json
import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from experiments.records import record
from experiments.records.record import Finished, read_curve, read_record, run_id
from experiments.records.results import Results

leaves = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text())
configs = st.dictionaries(st.text(), leaves, max_size=4)


@given(configs, configs)
def test_ids_differ_exactly_when_configs_do(a, b):
    same = json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)  # 1, 1.0, true differ
    assert (run_id("s", "m", a, "f") == run_id("s", "m", b, "f")) == same
    assert run_id("s", "m", a, "f") == run_id("s", "m", dict(reversed(a.items())), "f")
    assert run_id("s", "m", a, "f") != run_id("s", "m", a, "g")
    assert run_id("s", "m", a, "f").startswith("s-m-")


def test_json_has_plain_values_a_line_a_key():
    entry = {
        "array": np.arange(3),
        "tensor": torch.tensor([[1, 2]]),
        "scalar": np.float32(0.5),
        "nan": math.nan,
        "inside": [{"infinite": (math.inf, 1.5)}],
        "name": "≤ 0 µm",
    }
    text = record.to_json(entry)
    assert len(text.splitlines()) == 2 + len(entry)
    assert json.loads(text) == {
        "array": [0, 1, 2],
        "tensor": [[1, 2]],
        "scalar": 0.5,
        "nan": None,
        "inside": [{"infinite": [None, 1.5]}],
        "name": "≤ 0 µm",
    }
    with pytest.raises(TypeError, match="expected plain values, found object"):
        record.to_json({"a": object()})


def test_nothing_is_written_that_would_not_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "MOST_BYTES", 10)
    with pytest.raises(ValueError, match="expected at most 10 bytes, found"):
        record.write_record(tmp_path, {"a": "long enough"})
    assert list(tmp_path.iterdir()) == []


def test_no_record_is_none(tmp_path):
    assert read_record(tmp_path / "nowhere") is None


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b'{"schema": 3, "status": "fini',
        b"\xff\xfe\x00",
        b"[1, 2]",
        b"null",
        b'{"status": "finished"}',
        b'{"schema": 99, "status": "finished"}',
        b'{"schema": 3}',
        b'{"schema": 3, "status": "finished", "training_s": NaN}',
        b"[" * 100_000,
        b"9" * 10_000,
    ],
    ids=lambda content: repr(content)[:60],
)
def test_a_file_that_is_no_record_is_named(tmp_path, content):
    path = tmp_path / "record.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="expected") as caught:
        read_record(tmp_path)
    assert str(path) in str(caught.value)


@given(st.binary(max_size=200))
def test_random_bytes_give_the_named_error(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "record.json")
        path.write_bytes(content)
        with pytest.raises(ValueError, match="expected"):
            read_record(Path(folder))


# One wrong value ----------------------------------------------------------------------------------


@pytest.fixture
def a_run(tmp_path, write_run):
    """The folder of a finished run of 100 test samples in five classes."""
    return tmp_path / "runs" / write_run("hdc")


def changed(folder, path, value):
    """Put a value at a dotted key of a record."""
    entry = json.loads((folder / "record.json").read_text())
    node = entry
    *before, last = path.split(".")
    for key in before:
        node = node[key]
    node[last] = value
    (folder / "record.json").write_text(json.dumps(entry))


def test_a_record_comes_back_typed(a_run):
    entry = read_record(a_run)
    assert isinstance(entry, Finished)
    assert entry.right.tolist() == [True] * 100
    assert (entry.seed, entry.scene.shape, entry.choices.model) == (0, (500, 500), "hdc")


CANNOT_BE = [
    # (what, its value, what is said of it)
    ("predicted", [-1] * 100, r"predicted\[0\]: expected `int` >= 0"),
    ("predicted", [99] * 100, "predicted: expected labels below 5, found 99"),
    ("predicted", [0] * 99, "predicted: expected n_test = 100 of them, found 99"),
    ("predicted", [1] * 100, "test_accuracy_final: expected 0.2 as its predictions say, found 1"),
    ("test_labels", [10**15] * 100, "test_labels: expected labels below 5"),
    ("test_accuracy_final", 0.99, "test_accuracy_final: expected 1 as its predictions say"),
    ("test_accuracy_final", 1.5, "test_accuracy_final: expected `float` <= 1"),
    ("test_accuracy_max", 0.5, "test_accuracy_max: expected 1.0 as the curve says, found 0.5"),
    ("train_accuracy_max", None, "train_accuracy_max: expected 1.0 as the curve says, found None"),
    ("n_train", 9 * 10**15, "n_train: expected `int` <= 9007199254740992, found|n_train: exp"),
    ("n_train", 401, "n_train: expected at most 400 of the scene's 500 samples, found 401"),
    ("n_test", True, "n_test: expected `int`, got `bool`"),
    ("model_bytes", -1, "model_bytes: expected `int` >= 0"),
    ("model_bytes", 10**400, "expected a record in JSON|model_bytes"),
    ("training_s", 0, "training_s: expected more than 0 s, found 0"),
    ("training_s", -1, "training_s: expected `float` >= 0"),
    ("training_s", 1e299, "training_s: expected `float` <= 1000000000.0"),
    ("training_s", 0.1, "time_to_target_train_s: expected at most training_s, found 0.5"),
    ("training_s", 0.5 - 1e-9, "expected at most training_s"),
    ("time_to_target_test_s", 99, "time_to_target_test_s: expected at most training_s, found 99"),
    ("scene.shape", [1, 1], "scene.shape: expected at least the pixels seen, found 1"),
    ("scene.shape", [500], r"scene.shape: expected `array` of length 2, got 1"),
    ("scene.n", 9, "n_train: expected at most -91"),
    ("scene.name", "finger", "scene.name: expected touch as said elsewhere, found finger"),
    ("scene.classes", ["a"] * 4, "labels below 4, found 4"),
    ("scene.fingerprint", "0" * 64, "id: expected touch-hdc-.* as choices, config and finger"),
    ("choices.model", "../model/hdc", "choices.model: expected `str` matching regex"),
    ("choices.model", "softmax", "id: expected touch-softmax-"),
    ("choices.stop", ["paper"], r"choices.stop: expected `str \| null`, got `array`"),
    ("choices.stop", {}, r"choices.stop: expected `str \| null`, got `object`"),
    ("command", None, "command: expected `str`, got `null`"),
    ("command", ["python"], "command: expected `str`, got `array`"),
    ("config.model.ties", "one", "id: expected touch-hdc-"),
    ("config.seed.run", "${oc.env:HOME}", "config.seed.run: expected `int`"),
    ("config.split", {}, "config.split: expected the key `n_train`"),
    ("config.scene", None, "config.scene: expected `object`, got `null`"),
    ("config.data.pixels", 0, "config.data.pixels: expected `int` >= 1"),
    ("environment.packages", None, "environment.packages: expected `object`, got `null`"),
    ("environment.threads", 1, "environment.threads: expected 2 as said elsewhere, found 1"),
    ("stop", "x\n| y", "stop: expected a known word, found"),
    ("stop", "x" * 20_000, "stop: expected a known word, found"),
    ("status", "done", "status: expected one of running, finished"),
    ("id", "touch-hdc-000000000000", "id: expected touch-hdc-"),
]


@pytest.mark.parametrize(("key", "value", "message"), CANNOT_BE, ids=lambda x: str(x)[:20])
def test_what_cannot_be_leaves_its_record_out_by_name_and_the_rest_stands(
    a_run, write_run, tmp_path, key, value, message
):
    other = write_run("hdc", seed=1)
    changed(a_run, key, value)
    found = Results(tmp_path)
    assert [run.record.id for run in found.runs] == [other]
    (problem,) = found.problems
    assert problem.startswith(f"{a_run.name}: ")
    with pytest.raises(ValueError, match=message):
        raise ValueError(problem)
    assert len(problem) < 500


def test_a_record_in_the_folder_of_another_is_named(a_run):
    a_run.rename(a_run.with_name("copy"))
    with pytest.raises(ValueError, match=f"expected that of its folder, found {a_run.name}"):
        read_record(a_run.with_name("copy"))


def test_accuracies_that_no_report_has_are_none(write_run, tmp_path):
    """A model whose every loss is NaN; the report ended with a TypeError."""
    folder = tmp_path / "runs" / write_run("softmax", stop="paper")
    record.write_curve(folder, [{"training_s": 0.5, "loss": math.nan}])
    for key in ("train_accuracy_max", "test_accuracy_max"):
        changed(folder, key, None)
    found = Results(tmp_path)
    assert (len(found.runs), found.problems) == (1, [])


def test_a_run_that_broke_off_keeps_what_it_has(tmp_path, write_run):
    folder = tmp_path / "runs" / write_run("hdc", status="failed", error="KeyError: \\")
    changed(folder, "training_s", 2.5)
    entry = read_record(folder)
    assert not isinstance(entry, Finished)
    assert (entry.error, entry.training_s) == ("KeyError: \\", 2.5)


def test_a_long_command_is_read_again(a_run):
    changed(a_run, "command", "python " + ",".join(map(str, range(30_000))))
    assert len(read_record(a_run).command) > 100_000


# Curves -------------------------------------------------------------------------------------------


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
    assert [list(row.values()) for row in read] == [
        ["0.30000000000000004", "64", "0.5", ""],
        ["1.0", "128", "", "nan"],
        ["2.0", "", "", "inf"],
    ]
    first, second, third = read_curve(tmp_path / "curve.csv")
    assert first == {"training_s": 0.1 + 0.2, "samples_seen": 64, "train_accuracy": 0.5}
    assert math.isnan(second.pop("loss"))
    assert (second, third) == (
        {"training_s": 1, "samples_seen": 128},
        {"training_s": 2, "loss": math.inf},
    )


@pytest.mark.parametrize(
    "text",
    [
        "training_s,loss\n1,2,3\n",
        "training_s\n-1\n",
        "training_s\nnan\n",
        "loss\n1\n",
        "training_s\nx\n",
    ],
)
def test_a_table_that_is_no_curve_is_named(tmp_path, text):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(ValueError, match=r"curve\.csv: expected a curve, found"):
        read_curve(tmp_path / "curve.csv")


@pytest.mark.parametrize(
    "text",
    [
        "training_s,train_accuracy,test_accuracy\n",
        "training_s,train_accuracy,test_accuracy\n0.5,1,1\n0.4,1,1\n",
        "training_s,train_accuracy,test_accuracy\n9,1,1\n",
        "training_s,train_accuracy,test_accuracy\n0.5,7,7\n",
    ],
)
def test_a_curve_that_says_other_than_its_record_leaves_it_out(tmp_path, a_run, text):
    (a_run / "curve.csv").write_text(text)
    found = Results(tmp_path)
    assert found.runs == []
    assert "curve" in found.problems[0]
