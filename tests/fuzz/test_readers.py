"""Hypothesis against every reader: whatever a file or a setting holds, an error names it."""

from __future__ import annotations

import copy
import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments import fuzz_files, fuzz_records, measurement, schema, selection, tables
from experiments.fuzz import kinds
from experiments.fuzz_files import write
from experiments.fuzz_records import RUN
from scenes.recorded import open_recording

RECORD = json.loads(fuzz_records.run_record())

edits = st.lists(
    st.tuples(
        st.sampled_from(["put", "insert", "cut"]),
        st.floats(0, 1),
        st.binary(min_size=1, max_size=16),
    ),
    min_size=1,
    max_size=6,
)


def edited(data, changes):
    for what, where, some in changes:
        at = int(where * len(data))
        rest = data[at if what == "insert" else at + len(some) :]
        data = data[:at] + (b"" if what == "cut" else some) + rest
    return data


@given(st.integers(0, len(kinds()) - 1), edits)
@settings(max_examples=300, deadline=None)
def test_files_with_edits_anywhere(k, changes):
    kind = kinds()[k]
    data = edited(kind.make(), changes)
    with tempfile.TemporaryDirectory() as folder:
        write({**kind.around(), kind.name: kind.mend(data) if kind.mend else data}, Path(folder))
        try:
            assert kind.read(Path(folder))
        except ValueError as error:
            assert folder in str(error) or RUN in str(error)  # noqa: PT017


@given(st.sampled_from([".png", ".jpg", ".bmp", ".tiff", ".npz", ".avi", ".mp4"]), st.binary())
@settings(max_examples=100, deadline=None)
def test_files_of_any_bytes(suffix, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"x{suffix}")
        mark = {".png": b"\x89PNG\r\n\x1a\n", ".jpg": b"\xff\xd8\xff", ".bmp": b"BM"}
        path.write_bytes(mark.get(suffix, b"") + data)
        write({"x.csv": b"start_s,end_s,label\n0,1,a\n1,2,b\n"}, Path(folder))
        with pytest.raises(ValueError, match="expected") as caught:
            open_recording(path if suffix in (".npz", ".avi", ".mp4") else folder)
        assert folder in str(caught.value)


values = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(),
        st.sampled_from(["${seed.run}", "${oc.env:HOME}", "../touch", "touch,finger", 10**400]),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


def places(tree, path=()):
    if path:
        yield path
    if isinstance(tree, dict | list):
        for key in tree if isinstance(tree, dict) else range(len(tree)):
            yield from places(tree[key], (*path, key))


PLACES = [path for path in places(RECORD) if path[:2] != ("environment", "sources")]


@given(st.sampled_from(PLACES), values)
@settings(max_examples=200, deadline=None)
def test_a_record_with_another_value_in_any_field(path, value):
    changed = copy.deepcopy(RECORD)
    node = changed
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    with tempfile.TemporaryDirectory() as folder:
        write({f"runs/{RUN}/record.json": json.dumps(changed).encode()}, Path(folder))
        try:
            assert fuzz_records.read_run(Path(folder))
        except ValueError as error:
            assert RUN in str(error)  # noqa: PT017


@given(st.text(alphabet=st.sampled_from('training_s,"0159.e+-n\n\r\0é'), max_size=60))
@settings(max_examples=100, deadline=None)
def test_curves_and_rows_of_any_text(text):
    with tempfile.TemporaryDirectory() as folder:
        write({"curve.csv": text.encode(), "measured/m/rows.csv": text.encode()}, Path(folder))
        entry = dict(fuzz_records.measured())["measured/m/record.json"]
        write({"measured/m/record.json": entry}, Path(folder))
        for read, name in (
            (lambda: selection.read_curve(Path(folder, "curve.csv")), "curve.csv"),
            (lambda: measurement.read(Path(folder), "m").rows, "rows.csv"),
        ):
            try:
                rows = read()
            except ValueError as error:
                assert name in str(error)  # noqa: PT017
            else:
                assert all(isinstance(key, str) for row in rows for key in row)


KEYS = ["crop", "subsample", "on_bad_frame", "threads", "memory_bytes", "max_pixels", "intervals"]


@given(st.sampled_from(KEYS), values)
@settings(max_examples=150, deadline=None)
def test_settings_of_any_kind(key, value):
    with tempfile.TemporaryDirectory() as folder:
        write(fuzz_files.good_frame(), Path(folder))
        write({"b/1.png": fuzz_files.good_frame()["a/1.png"]}, Path(folder))
        try:
            scene = open_recording(folder, **{key: value})
        except ValueError as error:
            assert f"scene.{key}" in str(error)  # noqa: PT017
        else:
            assert len(scene) == 2


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("training_s",), -1, "training_s: expected seconds, found -1"),
        (("n_test",), True, "n_test: expected an integer ≥ 1, found True"),
        (("predicted",), [0, 0, 1], "predicted: expected n_test = 5 integers, found 3"),
        (("scene", "shape"), [500], "scene.shape: expected two integers ≥ 1"),
        (("confusion",), [[1]], "confusion: expected 2 rows and columns"),
        (("choices", "model"), "../model/hdc", "choices.model: expected a name"),
        (("config", "seed", "run"), "${oc.env:HOME}", "config.seed: expected a mapping to integ"),
        (("config", "split"), 3, "config.split.n_train: expected an integer ≥ 1, found none"),
        (("test_accuracy_final",), 1.5, "test_accuracy_final: expected a fraction, found 1.5"),
        (("stop",), "x" * 20_000, r"stop: expected a text, found 'x+…"),
        pytest.param(
            ("model_bytes",), 10**5000, "model_bytes: expected an integer, found int", id="huge"
        ),
    ],
)
def test_a_wrong_field_is_named(path, value, message):
    changed = copy.deepcopy(RECORD)
    node = changed
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    with pytest.raises(ValueError, match=message):
        schema.check_run(changed)


def test_a_sound_record_and_one_that_has_not_finished_pass():
    schema.check_run(RECORD)
    started = {key: value for key, value in RECORD.items() if key not in schema._FINISHED}
    schema.check_run({**started, "status": "failed", "error": "ValueError: no"})


@pytest.mark.parametrize(
    "content",
    [
        b'{"schema": 2, "status": "failed", "status": "finished"}',
        b'{"schema": 2, "status": "finished", "training_s": NaN}',
        b'{"schema": 2, "status": "finished", "training_s": -Infinity}',
        b'{"schema": 2, "status": "finished", "a": ' + b'{"a":' * 5000 + b"1" + b"}" * 5001,
    ],
    ids=["a key twice", "NaN", "infinity", "deep"],
)
def test_json_that_readers_understand_differently_is_no_record(tmp_path, content):
    write({f"runs/{RUN}/record.json": content}, tmp_path)
    (problem,) = selection.Records(tmp_path).problems
    assert problem.startswith(f"{RUN}: ValueError: ")
    assert "expected a record in JSON" in problem


def test_a_record_that_is_a_pipe_or_a_folder_is_not_waited_for(tmp_path):
    import os

    (tmp_path / "runs" / "folder" / "record.json").mkdir(parents=True)
    (tmp_path / "runs" / "pipe").mkdir()
    os.mkfifo(tmp_path / "runs" / "pipe" / "record.json")
    assert len(selection.Records(tmp_path).problems) == 2


@pytest.mark.parametrize(
    "content",
    [
        b"experiment,quantity,value,unit\nt,q,1 s,s\n",
        b"experiment,quantity,value\nt,q,1\n",
        b"experiment,quantity,value,unit\n\xff,q,1,s\n",
        b'experiment,quantity,value,unit\n"t,q,1,s',
    ],
)
def test_published_numbers_that_are_none_are_named(tmp_path, monkeypatch, content):
    write({"results/published.csv": content}, tmp_path)
    monkeypatch.setattr(tables, "ROOT", tmp_path)
    with pytest.raises(ValueError, match=r"results/published\.csv: expected experiment, quant"):
        tables.published.__wrapped__()
