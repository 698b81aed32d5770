"""Records: one folder a run with record.json and curve.csv, written whole or not at all.

A record is a file, and files are edited, cut and merged by hand. What is wrong with one is named
with its key, and costs that record only.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from experiments.records.files import read_text, write_atomically

SCHEMA = 3
# Keys of a config that say how a run is carried out, or how it is shown, not what it computes.
NOT_IDENTITY = ("force", "cache", "exclusive", "task", "display")
STATUSES = ("running", "finished", "failed", "interrupted")
MOST_BYTES = 2**24
"""Size of the largest record that is written or read, of a million test samples; usual ones have
some thousand bytes."""
_MOST_SAID = 200  # characters of what is wrong with a value
MOST_ROW_BYTES = 2**21
"""Size of the largest curve, or table of rows: some ten thousand rows. As Python objects they take
up to a hundred times as many bytes."""

Text = Annotated[str, Meta(max_length=10_000)]
Line = Annotated[str, Meta(max_length=2**21)]  # what a system lets a command line hold
Name = Annotated[str, Meta(pattern=r"^(?!.*\.\.)[\w./-]+$", max_length=200)]
Count = Annotated[int, Meta(ge=1, le=2**53)]
Index = Annotated[int, Meta(ge=0, le=2**53)]
Whole = Annotated[int, Meta(ge=-(2**53), le=2**53)]
Seconds = Annotated[float, Meta(ge=0, le=1e9)]
Fraction = Annotated[float, Meta(ge=0, le=1)]
# plateau: of records from before there was a criterion on the loss
Ending = Literal["finished", "trained", "reached", "steps", "plateau", "budget", "diverged"]
Curve = list[dict[str, float]]


class Choices(msgspec.Struct):
    """Which file of each group of ``configs/`` a run was composed from, or ``custom``."""

    scene: Name
    model: Name
    stop: Text | None = None


class SceneOf(msgspec.Struct):
    """What a run saw.

    Attributes:
        name: name of the scene's config.
        origin: ``simulated``, ``measured`` or ``recorded``.
        classes: class names, by label.
        shape: rows and columns of a frame.
        n: number of samples.
        fingerprint: digest of what determines the frames.
        skipped: frames that could not be read, with the reason.
    """

    name: Name
    origin: Text
    classes: list[Text]
    shape: tuple[Count, Count]
    n: Count
    fingerprint: Text
    skipped: list[Text] = []


class Environment(msgspec.Struct):
    """Machine and code, as :func:`experiments.records.environment.environment` tells them."""

    cpu: Text
    threads: Count
    code: Text
    sources: dict[str, str]
    packages: dict[str, str | None] = {}
    exclusive: bool = True
    python: Text | None = None
    platform: Text | None = None
    cores: Count | None = None
    device: Text | None = None
    commit: Text | None = None
    dirty: bool | None = None


class _Seeds(msgspec.Struct):
    run: Whole


class _Split(msgspec.Struct):
    n_train: Count | None


class _Data(msgspec.Struct):
    pixels: Count | None


class _Stop(msgspec.Struct):
    target: Annotated[float, Meta(gt=0, lt=1)]


class _Config(msgspec.Struct):
    """The parts of a config that readers rely on."""

    device: Text
    threads: Count
    scene: dict[str, Any]
    model: dict[str, Any]
    seed: _Seeds
    split: _Split
    data: _Data
    stop: _Stop


class Digests(msgspec.Struct):
    """SHA-256 of the frames and labels that trained and tested."""

    train: Text
    test: Text


class Record(msgspec.Struct, kw_only=True):
    """A run that has begun.

    Attributes:
        id: its name, which is that of its folder.
        overrides: what the command line, or an experiment, set.
        display: how the model's config wants it shown.
        config: everything that determines it, resolved.
        training_s: seconds of training, as far as it came.
        timed_again: seconds of training of the run in whose place it stands, which took unlike as
            long as its siblings.
        relabelled: where it was known under another name: schema, commit and id of then.
    """

    schema: int
    id: Text
    status: Text
    choices: Choices
    config: dict[str, Any]
    environment: Environment
    scene: SceneOf
    command: Line = ""
    experiment: Text | None = None
    overrides: list[Line] = []
    display: dict[str, Text] = {}
    training_s: Seconds | None = None
    error: Text | None = None
    timed_again: Seconds | None = None
    relabelled: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status: expected one of {', '.join(STATUSES)}")
        convert(self.config, _Config, "config")
        known = run_id(self.choices.scene, self.choices.model, self.config, self.scene.fingerprint)
        if self.id != known:
            raise ValueError(
                f"id: expected {known} as choices, config and fingerprint say, found {self.id}"
            )
        for key, one, other in (
            ("scene.name", self.scene.name, self.choices.scene),
            ("environment.threads", self.environment.threads, self.config["threads"]),
        ):
            if one != other:
                raise ValueError(f"{key}: expected {other} as said elsewhere, found {one}")

    @property
    def seed(self) -> int:
        """``seed.run``."""
        return int(self.config["seed"]["run"])


class Finished(Record, kw_only=True):
    """A run that has ended well.

    Attributes:
        stop: why it ended, one of :data:`Ending`.
        training_s: seconds of training.
        time_to_target_train_s, time_to_target_test_s: seconds until an accuracy first exceeded
            ``config.stop.target``, if it did.
        train_accuracy_at_target, test_accuracy_at_target: accuracies when that of training first
            did; not in records from before they were noted.
        train_accuracy_max, test_accuracy_max: largest accuracies of the curve, if it has any.
        model_bytes: size of what was learnt; None where it is not known.
        test_labels, predicted: class of each test sample, true and predicted by the last model.
    """

    stop: Ending
    training_s: Seconds
    time_to_target_train_s: Seconds | None = None
    time_to_target_test_s: Seconds | None = None
    train_accuracy_at_target: Fraction | None = None
    test_accuracy_at_target: Fraction | None = None
    train_accuracy_max: Fraction | None = None
    train_accuracy_final: Fraction
    test_accuracy_max: Fraction | None = None
    test_accuracy_final: Fraction
    model_bytes: Index | None = None
    n_train: Count
    n_test: Count
    test_labels: list[Index]
    predicted: list[Index]
    predict_single_s: Seconds
    predict_batch_s_per_frame: Seconds
    data_sha256: Digests

    def __post_init__(self) -> None:
        super().__post_init__()
        classes = len(self.scene.classes)
        for key in ("test_labels", "predicted"):
            found = getattr(self, key)
            if len(found) != self.n_test:
                raise ValueError(
                    f"{key}: expected n_test = {self.n_test} of them, found {len(found)}"
                )
            if max(found) >= classes:
                raise ValueError(f"{key}: expected labels below {classes}, found {max(found)}")
        if self.n_train + self.n_test > self.scene.n:
            raise ValueError(
                f"n_train: expected at most {self.scene.n - self.n_test} of the "
                f"scene's {self.scene.n} samples, found {self.n_train}"
            )
        pixels = math.prod(self.scene.shape)
        if not 2 <= (self.config["data"]["pixels"] or pixels) <= pixels:
            raise ValueError(f"scene.shape: expected at least the pixels seen, found {pixels}")
        if not self.training_s > 0:
            raise ValueError("training_s: expected more than 0 s, found 0")
        for key in ("time_to_target_train_s", "time_to_target_test_s"):
            if (getattr(self, key) or 0) > self.training_s:
                raise ValueError(f"{key}: expected at most training_s, found {getattr(self, key)}")
        accuracy = float(self.right.mean())
        if not math.isclose(accuracy, self.test_accuracy_final, abs_tol=1e-9):
            raise ValueError(
                f"test_accuracy_final: expected {accuracy:g} as its predictions say, "
                f"found {self.test_accuracy_final:g}"
            )

    @property
    def right(self) -> np.ndarray:
        """Which test samples the last model has right, bool [n_test]."""
        return np.equal(self.predicted, self.test_labels)

    def check_curve(self, curve: Curve) -> None:
        """Compare what the record and its curve both say.

        Raises:
            ValueError: naming what differs.
        """
        if not curve:
            raise ValueError("curve: expected a row a report, found none")
        times = [row["training_s"] for row in curve]
        if times != sorted(times) or times[-1] > self.training_s:
            raise ValueError(f"curve: expected rising times up to training_s = {self.training_s:g}")
        for part in ("train", "test"):
            seen = [row[key] for row in curve if (key := f"{part}_accuracy") in row]
            largest, said = max(seen, default=None), getattr(self, f"{part}_accuracy_max")
            if largest != said:
                raise ValueError(
                    f"{part}_accuracy_max: expected {largest} as the curve says, found {said}"
                )


def run_id(scene: str, model: str, config: Mapping[str, Any], fingerprint: str) -> str:
    """Name of a run: what it is, and a hash of everything that determines it."""
    payload = json.dumps([SCHEMA, config, fingerprint], sort_keys=True)
    return f"{scene}-{model}-{hashlib.sha256(payload.encode()).hexdigest()[:12]}"


def to_json(record: Mapping[str, Any]) -> str:
    """A record as text, a line a key; numbers that JSON lacks (NaN, infinities) become null.

    Raises:
        ValueError: if it would be larger than what is read again.
    """
    lines = (
        f"{json.dumps(key)}: {msgspec.json.encode(value, enc_hook=_plain).decode()}"
        for key, value in sorted(record.items())
    )
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    if len(text) > MOST_BYTES:
        raise ValueError(f"record: expected at most {MOST_BYTES} bytes, found {len(text)}")
    return text


def from_json(text: str | bytes) -> Record:
    """The record in a text.

    Raises:
        ValueError: naming the key that is wrong, what was expected and what was found.
    """
    try:
        entry = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise ValueError(f"expected a record in JSON, found {error}") from error
    return checked(entry)


def checked(entry: Any) -> Record:
    """The record that was read as plain values; raises as :func:`from_json`."""
    schema = entry.get("schema") if isinstance(entry, dict) else None
    if schema != SCHEMA:
        raise ValueError(f"expected a record of schema {SCHEMA}, found {schema!r}")
    kind = Finished if entry.get("status") == "finished" else Record
    return convert(entry, kind, "")


def read_record(folder: Path) -> Record | None:
    """The record in a folder, or None if there is none yet.

    Raises:
        ValueError: if there is a file that is no record; it is named with what is wrong.
    """
    path = folder / "record.json"
    try:
        record = from_json(read_text(path, MOST_BYTES))
        if record.id != folder.name:
            raise ValueError(f"id: expected that of its folder, found {record.id}")
        return record
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(f"{path}: expected a readable record, found: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write record.json."""
    write_atomically(folder / "record.json", to_json(record))


def write_curve(folder: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """Write curve.csv: one row a report of the model."""
    write_atomically(
        folder / "curve.csv",
        to_csv(
            [
                {key: getattr(value, "item", lambda v=value: v)() for key, value in row.items()}
                for row in rows
            ]
        ),
    )


def read_curve(path: Path) -> Curve:
    """The rows of curve.csv; empty cells are left out, no file is no rows.

    Raises:
        ValueError: naming the file, if it is no table of numbers with the times of its rows.
    """
    if not path.exists():
        return []
    try:
        rows = csv.DictReader(read_text(path, MOST_ROW_BYTES).splitlines(keepends=True))
        return checked_curve(rows)
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise ValueError(f"{path}: expected a curve, found: {error}") from error


def checked_curve(rows: Iterable[Mapping[str, Any]]) -> Curve:
    """Rows of texts as rows of numbers, without the empty ones.

    Raises:
        ValueError, TypeError: for what is no number, or a row without its time.
    """
    curve = [
        {key: float(text) for key, text in row.items() if text not in ("", None)} for row in rows
    ]
    if not all(0 <= row.get("training_s", -1) < math.inf for row in curve):
        raise ValueError("rows without seconds in the column training_s")
    return curve


def to_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, a column for every key in the order of their first appearance."""
    text = io.StringIO()
    columns = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, columns, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def convert(value: Any, kind: Any, key: str) -> Any:
    """The value as that type; an error names the key as a config does."""
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at `$")
        place = ".".join(filter(None, [key, where.rstrip("`").lstrip(".")]))
        text = what[0].lower() + what[1:_MOST_SAID]
        text = text.replace("object missing required field", "expected the key")
        text = text.replace("invalid enum value", "expected a known word, found")
        raise ValueError(f"{place}: {text}" if place else text) from None


def _plain(value: Any) -> Any:
    """NumPy arrays and tensors as lists; anything else is not for a record."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"record: expected plain values, found {type(value).__name__}")
