"""The record of a run: what it was, what came of it, and by which code on which machine.

A results folder holds its runs in one file that only grows, ``runs.jsonl``, a record a line. A run
that is made again adds a line; of several lines with one id the last finished one counts. A
malformed line is reported and skipped.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from experiments.records import locks
from experiments.records.entry import SCHEMA, Entry, name_of
from experiments.records.rows import pack_labels, plain, unpack_labels
from hdc.io import write_atomically

__all__ = ["SCHEMA", "Curve", "Finished", "Record"]

RUNS = "runs.jsonl"
# Keys of a config that say how a run is carried out, or how it is shown, not what it computes.
NOT_IDENTITY = (
    *("force", "cache", "exclusive", "task", "display", "scene_display"),
    "sessions",  # what the scene is made of, and has in itself
)
_PACKED = ("test_indices", "test_labels", "predicted")  # a text each in a line
# Keys of a config that whoever reads a record counts on.
_GROUPS = ("scene", "model", "stop", "split", "data", "seed")

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
        saturated: why the scene ranks no models, or nothing.
    """

    name: str
    origin: str
    classes: list[str]
    shape: tuple[int, int]
    n: int
    saturated: str = ""


class Digests(msgspec.Struct):
    """SHA-256 of the frames and labels that trained and tested."""

    train: str
    test: str


class Record(Entry, kw_only=True):
    """A run that did not finish.

    Attributes:
        choices: names of the files that it was composed from.
        overrides: what the command line, or an experiment, set.
        display, scene_display: how the configs of model and scene want them shown.
        curve: columns, and a row a report.
        training_s: seconds of training, as far as it came.

    Raises:
        ValueError: for a config without what every run has.
    """

    choices: Choices
    scene: SceneOf
    experiment: str | None = None
    overrides: list[str] = msgspec.field(default_factory=list)
    display: dict[str, Any] = msgspec.field(default_factory=dict)
    scene_display: dict[str, Any] = msgspec.field(default_factory=dict)
    curve: dict[str, list[Any]] = msgspec.field(default_factory=dict)
    training_s: float | None = None
    error: str | None = None

    def __post_init__(self) -> None:
        for group in _GROUPS:
            if not isinstance(self.config.get(group), dict):
                found = self.config.get(group)
                raise ValueError(f"config.{group}: expected a mapping, found {found!r}")
        for group, key in (("split", "n_train"), ("data", "pixels")):
            if key not in self.config[group]:
                raise ValueError(f"config.{group}.{key}: expected a value, found none")
        seed = self.config["seed"].get("run")
        if not isinstance(seed, int):
            raise ValueError(f"config.seed.run: expected an integer, found {seed!r}")

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

    Raises:
        ValueError: for labels that are not one a test sample, each one of the classes.
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

    def __post_init__(self) -> None:
        super().__post_init__()
        classes = len(self.scene.classes)
        for name in ("test_labels", "predicted"):
            labels = getattr(self, name)
            if len(labels) != self.n_test:
                found = len(labels)
                raise ValueError(
                    f"{name}: expected {self.n_test} labels, found {found}"
                )
            if labels and not 0 <= min(labels) <= max(labels) < classes:
                limits = f"{min(labels)} to {max(labels)}"
                expected = f"labels from 0 to {classes - 1}"
                raise ValueError(f"{name}: expected {expected}, found {limits}")

    @property
    def right(self) -> np.ndarray:
        """Which test samples the last model has right, bool [n_test]."""
        return np.equal(self.predicted, self.test_labels)


def run_id(
    scene: str,
    model: str,
    config: Mapping[str, Any],
    fingerprint: str,
) -> str:
    """Name of a run: what it is, and a hash of everything that determines it."""
    return name_of(f"{scene}-{model}", config, fingerprint)


def append(
    folder: Path,
    entry: Mapping[str, Any],
    curve: Curve,
) -> None:
    """Add a record, plain values, to the runs of a results folder."""
    _append(folder, to_line(entry, curve))


def append_decoded(folder: Path, entry: Mapping[str, Any]) -> None:
    """Add a decoded line of another folder to the runs of a results folder."""
    _append(folder, msgspec.json.encode(entry, order="sorted").decode())


def _append(folder: Path, line: str) -> None:
    lock = locks.held(folder / "cache" / "locks" / RUNS, timeout_s=-1)
    with lock, (folder / RUNS).open("a+b") as file:
        if file.tell():  # a line that a kill cut short must not spoil the next
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                line = f"\n{line}"
        file.write(f"{line}\n".encode())
        file.flush()
        os.fsync(file.fileno())


def to_line(entry: Mapping[str, Any], curve: Curve) -> str:
    """A record as a line of JSON."""
    columns = list(dict.fromkeys(key for row in curve for key in row))
    rows = [_values(row, columns) for row in curve]
    whole = {**entry, "curve": {"columns": columns, "rows": rows}}
    for key in _PACKED:
        if key in whole:
            whole[key] = pack_labels(whole[key])
    return msgspec.json.encode(whole, enc_hook=plain, order="sorted").decode()


def _values(
    row: Mapping[str, Any],
    columns: Iterable[str],
) -> list[Any]:
    return [_number(row.get(column)) for column in columns]


def _number(value: Any) -> float | str | None:
    """A value of a curve as JSON: infinities and NaN as texts."""
    number = value.item() if hasattr(value, "item") else value
    if number is None or math.isfinite(number):
        return number
    return str(number)


def read(folder: Path, name: str = "") -> Iterator[Record | ValueError]:
    """Every run of a results folder whose line has the name in it, by id: the last finished record
    of each, else its last. A line that is no record gives an error that names it."""
    path = folder / RUNS
    records: dict[str, Record] = {}
    lines = path.read_bytes().splitlines() if path.is_file() else []
    for number, line in enumerate(lines, 1):
        if name.encode() not in line:
            continue
        try:
            record = from_json(line)
        except (ValueError, RecursionError) as error:
            yield ValueError(f"{path}, line {number}: {error}")
            continue
        before = records.get(record.id)
        if isinstance(record, Finished) or not isinstance(before, Finished):
            records[record.id] = record
    yield from records.values()


def find(folder: Path, name: str) -> Finished | None:
    """The finished record of a run, or None."""
    for record in read(folder, name):
        if isinstance(record, Finished) and record.id == name:
            return record
    return None


def from_json(line: bytes) -> Record:
    """The record in a line; a ValueError names the key that is wrong."""
    values = msgspec.json.decode(line)
    if not isinstance(values, dict):
        raise ValueError(f"expected an object, found {type(values).__name__}")
    for key in _PACKED:
        if isinstance(values.get(key), str):
            values[key] = unpack_labels(values[key]).tolist()
    kind = Finished if values.get("status") == "finished" else Record
    record: Record = msgspec.convert(values, kind, strict=False)
    curve_of(record)  # one that cannot be read is no record
    return record


def curve_of(record: Record) -> Curve:
    """The curve of a record, without the values that a report did not have.

    Raises:
        ValueError: if it is no table of numbers.
    """
    columns = record.curve.get("columns", [])
    curve = []
    for values in record.curve.get("rows", []):
        try:
            pairs = list(zip(columns, values, strict=True))
            curve.append({key: float(v) for key, v in pairs if v is not None})
        except (TypeError, ValueError) as error:
            expected = f"{len(columns)} numbers a row"
            raise ValueError(f"curve: expected {expected}, found {values!r}") from error
    return curve


def write_all(folder: Path, entries: Iterable[Mapping[str, Any]]) -> None:
    """Replace the runs of a folder by decoded lines."""
    lines = [msgspec.json.encode(entry, order="sorted").decode() for entry in entries]
    write_atomically(folder / RUNS, "".join(f"{line}\n" for line in lines))
