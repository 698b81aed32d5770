"""The record of a run: what it was, what came of it, and by which code on which machine.

A results folder holds its runs in two files that only grow: ``runs.jsonl``, a record a line, and
``code.json`` with the digests of the code of each. A run that is made again adds a line; of several
lines with one id the last finished one counts. A malformed line is reported and skipped.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from experiments.records import locks
from hdc.io import write_atomically

SCHEMA = 3
RUNS, CODE = "runs.jsonl", "code.json"
# Keys of a config that say how a run is carried out, or how it is shown, not what it computes.
NOT_IDENTITY = (
    "force",
    "cache",
    "exclusive",
    "task",
    "display",
    "scene_display",
    "sessions",  # what the scene is made of, and has in itself
)

Curve = list[dict[str, float]]
"""A row a report of the model: ``training_s``, ``samples_seen``, accuracies, ``loss`` …"""


class Choices(msgspec.Struct):
    """Which file of each group of ``configs/`` a run was composed from, or ``custom``."""

    scene: str
    model: str
    stop: str | None = None


class SceneOf(msgspec.Struct):
    """The scene of a run.

    Attributes:
        name: name of the scene's config.
        origin: ``simulated``, ``computed``, ``measured`` or ``recorded``.
        classes: class names, by label.
        shape: rows and columns of a frame.
        n: number of samples.
        fingerprint: digest of everything that determines the frames.
        skipped: frames that could not be read, with the reason.
        saturated: why the scene ranks no models, or nothing.
    """

    name: str
    origin: str
    classes: list[str]
    shape: tuple[int, int]
    n: int
    fingerprint: str
    skipped: list[str] = []
    saturated: str = ""


class Environment(msgspec.Struct):
    """What is read of :func:`experiments.records.environment.environment`."""

    cpu: str
    threads: int
    code: str
    sources: dict[str, str] = {}
    exclusive: bool = True
    device: str | None = None


class Digests(msgspec.Struct):
    """SHA-256 of the frames and labels that trained and tested."""

    train: str
    test: str


class Record(msgspec.Struct, kw_only=True):
    """A run that did not finish.

    Attributes:
        id: names the run; a hash of everything that determines it is part of it.
        status: ``finished``, ``failed`` or ``interrupted``.
        overrides: what the command line, or an experiment, set.
        display: how the model's config wants it shown.
        config: everything that determines it, resolved.
        curve: a row a report.
        training_s: seconds of training, as far as it came.
    """

    schema: Literal[3]
    id: str
    status: str
    choices: Choices
    config: dict[str, Any]
    environment: Environment
    scene: SceneOf
    command: str = ""
    experiment: str | None = None
    overrides: list[str] = []
    display: dict[str, str] = {}
    curve: dict[str, list[Any]] = {}
    training_s: float | None = None
    error: str | None = None

    @property
    def seed(self) -> int:
        """``seed.run``."""
        return int(self.config["seed"]["run"])


class Finished(Record, kw_only=True):
    """A run that finished.

    Attributes:
        stop: why it ended, one of :data:`experiments.protocol.stop.NAMES`.
        training_s: seconds of training.
        time_to_target_train_s, time_to_target_test_s: seconds until an accuracy first exceeded
            ``config.stop.target``, if it did.
        train_accuracy_at_target, test_accuracy_at_target: when that of training first did.
        train_accuracy_max, test_accuracy_max: largest of the curve.
        model_bytes: size of what was learnt; None where it is not known.
        test_labels, predicted: class of each test sample, true and predicted by the last model.
    """

    stop: str
    training_s: float
    time_to_target_train_s: float | None = None
    time_to_target_test_s: float | None = None
    train_accuracy_at_target: float | None = None
    test_accuracy_at_target: float | None = None
    train_accuracy_max: float | None = None
    train_accuracy_final: float
    test_accuracy_max: float | None = None
    test_accuracy_final: float
    model_bytes: int | None = None
    n_train: int
    n_test: int
    test_labels: list[int]
    predicted: list[int]
    predict_single_s: float
    predict_batch_s_per_frame: float
    data_sha256: Digests

    @property
    def right(self) -> np.ndarray:
        """Which test samples the last model has right, bool [n_test]."""
        return np.equal(self.predicted, self.test_labels)


def run_id(scene: str, model: str, config: Mapping[str, Any], fingerprint: str) -> str:
    """Name of a run: what it is, and a hash of everything that determines it."""
    payload = json.dumps([SCHEMA, config, fingerprint], sort_keys=True)
    return f"{scene}-{model}-{hashlib.sha256(payload.encode()).hexdigest()[:12]}"


def append(folder: Path, entry: Mapping[str, Any], curve: Curve) -> None:
    """Add a record, plain values, to the runs of a results folder, its digests to code.json."""
    line, environment = to_line(entry, curve), entry["environment"]
    with locks.held(folder / "cache" / "locks" / RUNS, timeout_s=-1):
        code = read_code(folder)
        if environment["code"] not in code:
            _write_code(folder, {**code, environment["code"]: environment["sources"]})
        with (folder / RUNS).open("a+b") as file:
            if file.tell():  # a line that a kill cut short must not spoil the next
                file.seek(-1, os.SEEK_END)
                line = line if file.read(1) == b"\n" else f"\n{line}"
            file.write(f"{line}\n".encode())
            file.flush()
            os.fsync(file.fileno())


def to_line(entry: Mapping[str, Any], curve: Curve) -> str:
    """A record as a line of JSON."""
    columns = list(dict.fromkeys(key for row in curve for key in row))
    rows = [[_number(row.get(column)) for column in columns] for row in curve]
    environment = {k: v for k, v in entry["environment"].items() if k != "sources"}
    whole = {
        **entry,
        "environment": environment,
        "curve": {"columns": columns, "rows": rows},
    }
    return msgspec.json.encode(whole, enc_hook=plain, order="sorted").decode()


def _number(value: Any) -> float | str | None:
    """A value of a curve as JSON: infinities and NaN as texts."""
    value = getattr(value, "item", lambda: value)()
    return value if value is None or math.isfinite(value) else str(value)


def plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy and torch
        return value.tolist()
    raise TypeError(f"record: expected plain values, found {type(value).__name__}")


def read_code(folder: Path) -> dict[str, dict[str, str]]:
    """Digests of files by path, for each digest of the whole."""
    path = folder / CODE
    return msgspec.json.decode(path.read_bytes()) if path.is_file() else {}


def read(folder: Path, name: str = "") -> Iterator[Record | ValueError]:
    """Every run of a results folder whose line has the name in it, by id: the last finished record
    of each, else its last. A line that is no record gives an error that names it."""
    path, code = folder / RUNS, read_code(folder)
    records: dict[str, Record] = {}
    lines = path.read_bytes().splitlines() if path.is_file() else []
    for number, line in enumerate(lines, 1):
        if name.encode() not in line:
            continue
        try:
            record = from_json(line, code)
        except (ValueError, RecursionError) as error:
            yield ValueError(f"{path}, line {number}: {error}")
            continue
        if isinstance(record, Finished) or not isinstance(
            records.get(record.id), Finished
        ):
            records[record.id] = record
    yield from records.values()


def find(folder: Path, name: str) -> Finished | None:
    """The finished record of a run, or None."""
    found = (record for record in read(folder, name) if isinstance(record, Finished))
    return next((record for record in found if record.id == name), None)


def from_json(line: bytes, code: Mapping[str, dict[str, str]]) -> Record:
    """The record in a line; a ValueError names the key that is wrong."""
    record = msgspec.json.decode(line, type=Record, strict=False)
    if record.status == "finished":
        record = msgspec.json.decode(line, type=Finished, strict=False)
    record.environment.sources = code.get(record.environment.code, {})
    return record


def curve_of(record: Record) -> Curve:
    """The curve of a record, without the values that a report did not have."""
    columns = record.curve.get("columns", [])
    return [
        {
            key: float(value)
            for key, value in zip(columns, row, strict=True)
            if value is not None
        }
        for row in record.curve.get("rows", [])
    ]


def write_all(
    folder: Path,
    entries: Iterable[Mapping[str, Any]],
    code: Mapping[str, Mapping[str, str]],
) -> None:
    """Replace the runs of a folder by decoded lines, and its code by what of it they need."""
    entries = list(entries)
    used = {entry["environment"]["code"] for entry in entries}
    _write_code(folder, {name: code[name] for name in used})
    lines = (msgspec.json.encode(entry, order="sorted").decode() for entry in entries)
    write_atomically(folder / RUNS, "".join(f"{line}\n" for line in lines))


def _write_code(folder: Path, code: Mapping[str, Mapping[str, str]]) -> None:
    write_atomically(folder / CODE, json.dumps(code, indent=1, sort_keys=True) + "\n")
