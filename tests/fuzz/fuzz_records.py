"""Models and records, the files that this project writes: sound ones, and what reading gives."""

from __future__ import annotations

import functools
import hashlib
import json
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_damage import field_changed
from fuzz_files import Kind, noise
from hypothesis import strategies as st

from experiments.records import configs, measurement, record
from experiments.records.results import Results
from experiments.reporting.runs import runs_table
from hdc import HDCClassifier

# Models -------------------------------------------------------------------------------------------


@functools.cache
def _model() -> bytes:
    labels = np.array(["a", "b"])[np.arange(20) % 2]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "m")
        HDCClassifier().fit(noise(), labels).save(path)
        return path.read_bytes()


def _read_model(folder: Path) -> str:
    model = HDCClassifier.load(folder / "m")
    queries = np.resize(noise()[:3], (3, *model.frame_shape_))
    parts = model.predict(queries).tolist(), model.distances(queries).tolist()
    state = hashlib.sha256(repr((parts, model.counts_.tolist(), model.get_params())).encode())
    state.update(model.counters_.planes.numpy().tobytes())
    return state.hexdigest()


@st.composite
def _header_changed(draw: Callable[..., Any], data: bytes) -> bytes:
    """One field of the header that the model wrote into the safetensors file."""
    (length,) = struct.unpack_from("<Q", data)
    outer = json.loads(data[8 : 8 + length])
    inner = draw(field_changed(json.loads(outer["__metadata__"]["model"])))
    outer["__metadata__"]["model"] = json.dumps(inner)
    header = json.dumps(outer).encode()
    return struct.pack("<Q", len(header)) + header + data[8 + length :]


# Records ------------------------------------------------------------------------------------------


def _entry() -> dict:
    """As a run on a scene of ten samples would have left it."""
    names = {"scene": "touch", "model": "hdc", "stop": "paper"}
    config = {
        **configs.of_scene("touch"), **configs.of_model("hdc"), **configs.of_stop("paper"),
        "device": "cpu", "threads": 2, "seed": {"run": 0}, "data": {"pixels": None},
    }  # fmt: skip
    return {
        "schema": record.SCHEMA, "status": "finished", "config": config, "choices": names,
        "id": record.run_id("touch", "hdc", config, "f" * 64), "command": "python",
        "environment": {"cpu": "A CPU", "threads": 2, "code": "0", "sources": {"a.py": "0"}},
        "scene": {
            "name": "touch", "origin": "simulated", "shape": [500, 500], "n": 10,
            "classes": ["a", "b"], "skipped": [], "fingerprint": "f" * 64,
        },
        "stop": "finished", "training_s": 0.5, "time_to_target_train_s": 0.5,
        "time_to_target_test_s": None, "train_accuracy_max": 1.0, "train_accuracy_final": 1.0,
        "test_accuracy_max": 0.8, "test_accuracy_final": 0.8, "model_bytes": 1000, "n_train": 5,
        "n_test": 5, "test_labels": [0, 0, 1, 1, 1], "predicted": [0, 0, 1, 1, 0],
        "predict_single_s": 1e-3, "predict_batch_s_per_frame": 1e-4,
        "data_sha256": {"train": "a", "test": "b"},
    }  # fmt: skip


ENTRY = _entry()
RUN = f"runs/{ENTRY['id']}"
CURVE = b"training_s,samples_seen,train_accuracy,test_accuracy\n0.25,3,1.0,0.4\n0.5,5,1.0,0.8\n"
_RUN_FILES = {f"{RUN}/record.json": json.dumps(ENTRY).encode(), f"{RUN}/curve.csv": CURVE}
MEASURED = {
    "measured/m/record.json": json.dumps({
        "schema": record.SCHEMA, "name": "m", "identity": "0" * 12, "status": "finished",
        "config": {"seed": 0}, "seconds": 1.0, "peak_bytes": 10**8,
        "environment": {"cpu": "A CPU", "threads": 2, "code": "0", "sources": {"a.py": "0"}},
    }).encode(),
    "measured/m/rows.csv": b'n,error,note\n1,0.5,\n2,0.25,"a, b"\n',
}  # fmt: skip


def _packed() -> bytes:
    """The line of an archive."""
    entry = {**ENTRY, "curve": {"columns": ["training_s", "train_accuracy", "test_accuracy"],
                                "rows": [[0.5, 1.0, 0.8]]}}  # fmt: skip
    return json.dumps(entry).encode() + b"\n"


def read_run(folder: Path) -> str:
    """What a report is made of: the group of a run, and the table of all runs."""
    found = Results(folder)
    groups = [repr((group, group.status, group.classes, group.confusion().tolist()))
              for group in found.groups()]  # fmt: skip
    table = runs_table(found)
    text = repr((groups, table.csv(), table.markdown(), table.latex(), found.measurements))
    if found.problems:
        raise ValueError(f"{folder}: {found.problems[0]}")
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def _read_measured(folder: Path) -> str:
    found = measurement.read(folder / "measured" / "m")
    return repr((found.rows, found.record, found.outdated)) if found else "none"


def _json_changed(data: bytes) -> Any:
    return field_changed(json.loads(data)).map(lambda tree: json.dumps(tree).encode())


def kinds() -> list[Kind]:
    """All of these kinds."""
    made = [Kind("model: safetensors", "m", _model, _read_model, replace=_header_changed)]
    for kind, path, files, read in (
        ("of a run", f"{RUN}/record.json", _RUN_FILES, read_run),
        ("curve of a run", f"{RUN}/curve.csv", _RUN_FILES, read_run),
        (
            "of an archive",
            "runs.jsonl",
            {"runs.jsonl": _packed(), "code.json": b'{"0": {"a.py": "0"}}'},
            read_run,
        ),
        ("of a measurement", "measured/m/record.json", MEASURED, _read_measured),
        ("rows of a measurement", "measured/m/rows.csv", MEASURED, _read_measured),
    ):
        replace = None if path.endswith(".csv") else _json_changed
        sound = functools.partial(files.__getitem__, path)
        made.append(Kind(f"record: {kind}", path, sound, read, files.copy, None, replace))
    return made
