"""Models and records, the files that this project writes: sound ones, and what reading gives.

See :mod:`experiments.fuzz_files`.
"""

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
from omegaconf import OmegaConf

from experiments import measurement, record, selection, sources, table_text, tables
from experiments.fuzz_damage import field_of
from experiments.fuzz_files import Kind, Rng, noise
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


def _replace_in_model(data: bytes, rng: Rng) -> bytes:
    """One field of the header that the model wrote into the safetensors file."""
    (length,) = struct.unpack_from("<Q", data)
    outer = json.loads(data[8 : 8 + length])
    inner = field_of(json.loads(outer["__metadata__"]["model"]), rng)
    outer["__metadata__"]["model"] = json.dumps(inner)
    header = json.dumps(outer).encode()
    return struct.pack("<Q", len(header)) + header + data[8 + length :]


# Records ------------------------------------------------------------------------------------------

RUN = "touch-hdc-000000000000"
"""Folder of the run whose record is damaged; a report names it by that."""


@functools.cache
def run_record() -> bytes:
    """As a run on a scene of ten samples would have left it."""
    composed = selection.compose_run("touch", "hdc")
    config: Any = OmegaConf.to_container(composed, resolve=True)
    for key in ("force", "cache", "task"):
        config.pop(key)
    config["threads"] = 2
    files = sources.sources(config)
    truth = [0, 0, 1, 1, 1]
    entry = {
        "schema": record.SCHEMA, "id": RUN, "status": "finished", "config": config,
        "choices": {"scene": "touch", "model": "hdc", "stop": "paper"},
        "environment": {
            "cpu": "A CPU", "threads": 2, "code": sources.code_hash(files), "sources": files,
        },
        "scene": {
            "name": "touch", "origin": "simulated", "shape": [500, 500], "n": 10,
            "classes": ["a", "b"], "skipped": [],
        },
        "stop": "finished", "training_s": 0.5, "time_to_target_train_s": 0.5,
        "time_to_target_test_s": None, "train_accuracy_max": 1.0, "train_accuracy_final": 1.0,
        "test_accuracy_max": 0.8, "test_accuracy_final": 0.8, "test_ci_low": 0.4,
        "test_ci_high": 0.95, "model_bytes": 1000, "n_train": 5, "n_test": 5, "reports": 1,
        "test_labels": truth, "predicted": [0, 0, 1, 1, 0], "confusion": [[2, 0], [1, 2]],
        "predict_single_s": 1e-3, "predict_batch_s_per_frame": 1e-4,
        "data_sha256": {"train": "a", "test": "b"},
    }  # fmt: skip
    return json.dumps(entry, indent=1).encode()


_CURVE = b"training_s,samples_seen,train_accuracy,test_accuracy\n0.25,3,1.0,0.4\n0.5,5,1.0,0.8\n"


def _run_files() -> dict[str, bytes]:
    return {f"runs/{RUN}/record.json": run_record(), f"runs/{RUN}/curve.csv": _CURVE}


def read_run(folder: Path) -> str:
    """The row of Table I that the record makes, in every form, and its curve."""
    records = selection.Records(folder)
    if left_out := [*records.problems, *records.skipped]:
        raise ValueError(left_out[0])
    group = records.group("touch", "hdc")
    rows = [tables.row(group, group)]
    texts = (
        table_text.to_csv(rows, tables.TABLE1),
        table_text.to_markdown(rows, table_text.TABLE1_COLUMNS, "t"),
        table_text.to_latex(rows, table_text.TABLE1_COLUMNS, "t", "t"),
        repr([run.curve for run in group.runs]),
    )
    return hashlib.sha256(repr(texts).encode()).hexdigest()


def _replace_in_json(data: bytes, rng: Rng) -> bytes:
    return json.dumps(field_of(json.loads(data), rng)).encode()


@functools.cache
def measured() -> dict[str, bytes]:
    entry = {
        "schema": record.SCHEMA, "name": "m", "identity": "0" * 12, "status": "finished",
        "config": {"_target_": "experiments.fuzz.run"}, "seconds": 1.0, "peak_bytes": 10**8,
        "environment": {"code": "0", "sources": {"hdc/bits.py": "0" * 12}},
    }  # fmt: skip
    return {
        "measured/m/record.json": json.dumps(entry).encode(),
        "measured/m/rows.csv": b'n,error,note\n1,0.5,\n2,0.25,"a, b"\n',
    }


def _read_measured(folder: Path) -> str:
    found = measurement.read(folder, "m")
    text = repr((found and found.rows, found and found.record, found and found.outdated))
    return hashlib.sha256(text.encode()).hexdigest()


def _records() -> list[Kind]:
    def kind(variant: str, path: str, files: Callable[[], dict[str, bytes]], read: Any) -> Kind:
        replace = _replace_in_json if path.endswith(".json") else None
        return Kind("record", variant, path, lambda: files()[path], read, files, None, replace)

    return [
        kind("of a run", f"runs/{RUN}/record.json", _run_files, read_run),
        kind("curve of a run", f"runs/{RUN}/curve.csv", _run_files, read_run),
        kind("of a measurement", "measured/m/record.json", measured, _read_measured),
        kind("rows of a measurement", "measured/m/rows.csv", measured, _read_measured),
    ]


def kinds() -> list[Kind]:
    """All of these kinds."""
    model = Kind("model", "safetensors", "m", _model, _read_model, replace=_replace_in_model)
    return [model, *_records()]
