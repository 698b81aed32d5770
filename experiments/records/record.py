"""A record: what an experiment was, the rows that came of it, by which code and on which machine.

A measurement is an experiment whose rows are all that it yields. A run, the training of one model,
is an experiment as well: its rows are its curve, and it has results besides. A record is named
after its config and a digest of its data. Made again by other code it takes the place of the one
before.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from experiments.records import revision
from experiments.records.environment import Environment, changes
from experiments.records.revision import Revisions
from experiments.records.rows import Row, pack_labels, plain, unpack_labels
from hdc.accuracy import accuracy

if TYPE_CHECKING:
    import pandas as pd

SCHEMA: Literal[5] = 5
STEP = "EXPERIMENTS_STEP"
"""The environment variable that names the step of the reproduction that a process belongs to."""
# Keys of a config that say how a run is carried out, or how it is shown, not what it computes.
NOT_IDENTITY = (
    *("force", "cache", "exclusive", "task", "display", "scene_display"),
    "sessions",  # what the scene is made of, and has in itself
)
# Keys of a config that whoever reads a run counts on.
_GROUPS = ("scene", "model", "stop", "split", "data", "seed")
# Arguments of an experiment that say which frames there are.
_OF_FRAMES = ("scene", "split", "old_split")

Curve = list[dict[str, float]]
"""A row a report of the model: ``training_s``, ``samples_seen``, accuracies, ``loss`` …"""


class Rows(msgspec.Struct, frozen=True):
    """Rows as a table: names of columns, and a list of values a row; a missing value is None."""

    columns: list[str] = []
    values: list[list[Any]] = []

    def __post_init__(self) -> None:
        for values in self.values:
            if len(values) != len(self.columns):
                expected = f"{len(self.columns)} values a row"
                raise ValueError(f"rows: expected {expected}, found {values!r}")

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]]) -> Rows:
        """The table of rows by column."""
        listed = list(rows)
        columns = list(dict.fromkeys(key for row in listed for key in row))
        values = [[row.get(column) for column in columns] for row in listed]
        text = msgspec.json.encode(values, enc_hook=plain)
        return cls(columns, msgspec.json.decode(text))

    @classmethod
    def of_curve(cls, curve: Iterable[Mapping[str, float]]) -> Rows:
        """The table of a curve; JSON has no infinities and no NaN, which become texts."""
        return cls.of({key: _number(v) for key, v in row.items()} for row in curve)

    def dicts(self) -> list[Row]:
        """The rows by column."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.values]


class Record(msgspec.Struct, kw_only=True, omit_defaults=True, dict=True, eq=False):
    """What every record has.

    Attributes:
        id: names it; a hash of config and data is part of it.
        command: that a user typed.
        steps: of the reproduction that made it or found it finished, each ``MODE/NAME``.
        config: everything that determines it, resolved, as Hydra composed it.
        changed: values of the config that are not those of the files it was composed from, by key,
            as JSON; but for seeds.
        data: digest of everything that determines its frames.
        revisions: of all that took part, by name.
        environment: machine, libraries and commit.
        rows: what it yielded.
    """

    schema: Literal[5]
    id: str
    command: str = ""
    steps: list[str] = []
    config: dict[str, Any]
    changed: dict[str, str] = {}
    data: str = ""
    revisions: Revisions
    environment: Environment
    rows: Rows = Rows()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Record) and to_line(self) == to_line(other)

    @property
    def outdated(self) -> list[str]:
        """Why it would be made again today: what has another revision, or other changes."""
        names = revision.outdated(self.revisions, self.full_config)
        made_with = self.environment.changes
        if made_with is not None and made_with != changes():
            names.append("changes of a checkout that are in no commit")
        return names

    @property
    def full_config(self) -> dict[str, Any]:
        """The config with every ``_target_`` that took part."""
        return self.config


def _number(value: Any) -> float | str | None:
    number = value.item() if hasattr(value, "item") else value
    if number is None or math.isfinite(number):
        return number
    return str(number)


class Measurement(Record, tag="measurement", kw_only=True, omit_defaults=True):
    """An experiment that finished.

    Attributes:
        name: the experiment's.
        task: dotted name of what makes the rows of the config.
        scene: name of the scene's config, where it has one.
        seconds: of the call that made the rows.
    """

    name: str
    task: str = ""
    scene: str = ""
    seconds: float | None = None

    @property
    def full_config(self) -> dict[str, Any]:
        return {"_target_": self.task, **self.config}

    @functools.cached_property
    def frame(self) -> pd.DataFrame:
        """The rows as a data frame; a missing number is NaN, other missing values are None."""
        import pandas as pd  # a run does not wait for it

        return pd.DataFrame(self.rows.values, columns=self.rows.columns)

    @property
    def of_other_frames(self) -> bool:
        """Whether its frames, or which of them test, are not those of the experiment's config."""
        return any(key.partition(".")[0] in _OF_FRAMES for key in self.changed)


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


class RunRecord(Record, kw_only=True, omit_defaults=True):
    """What every record of a run has.

    Attributes:
        choices: names of the files that it was composed from.
        overrides: what the command line, or an experiment, set.
        display, scene_display: how the configs of model and scene want them shown.
        status: ``finished``, ``failed`` or ``interrupted``.
        training_s: seconds of training, as far as it came.

    Raises:
        ValueError: for a config without what every run has, or a curve that has other values than
            numbers.
    """

    choices: Choices
    scene: SceneOf
    experiment: str | None = None
    overrides: list[str] = []
    display: dict[str, Any] = {}
    scene_display: dict[str, Any] = {}
    status: str = "finished"
    error: str | None = None
    training_s: float | None = None

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
        _ = self.curve  # one that cannot be read is no record

    @property
    def seed(self) -> int:
        """``seed.run``."""
        return int(self.config["seed"]["run"])

    @functools.cached_property
    def curve(self) -> Curve:
        """A row a report, without the values that a report did not have."""
        curve = []
        for row in self.rows.dicts():
            try:
                numbers = {k: float(v) for k, v in row.items() if v is not None}
            except (TypeError, ValueError) as error:
                found = list(row.values())
                raise ValueError(f"curve: expected numbers, found {found}") from error
            curve.append(numbers)
        return curve


class Unfinished(RunRecord, tag="unfinished", kw_only=True, omit_defaults=True):
    """A run that did not finish."""

    stop: str | None = None


class Finished(RunRecord, tag="run", kw_only=True, omit_defaults=True):
    """A run that finished.

    Attributes:
        stop: why it ended, one of :data:`experiments.protocol.stop.NAMES`.
        training_s: seconds of training.
        time_to_target_train_s, time_to_target_test_s: seconds until an accuracy first exceeded
            ``config.stop.target``, if it did.
        train_accuracy_at_target, test_accuracy_at_target: when that of training first did.
        train_accuracy_max, test_accuracy_max: largest of the curve.
        model_bytes: size of what was learnt; None where it is not known.
        test_indices: which samples of the scene tested.
        test_labels, predicted: class of each test sample, true and predicted by the last model.

    Raises:
        ValueError: for labels that are not one a test sample, each one of the classes, or do not
            give the accuracy that is stated.
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
    test_indices: np.ndarray | None = None
    test_labels: np.ndarray
    predicted: np.ndarray
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
            if len(labels) and not 0 <= min(labels) <= max(labels) < classes:
                limits = f"{min(labels)} to {max(labels)}"
                expected = f"labels from 0 to {classes - 1}"
                raise ValueError(f"{name}: expected {expected}, found {limits}")
        stated = self.test_accuracy_final
        share = accuracy(self.predicted, self.test_labels)
        if not math.isclose(stated, share, abs_tol=1e-9):
            expected = f"{share:.6f} of the predictions beside it"
            raise ValueError(
                f"test_accuracy_final: expected {expected}, found {stated}"
            )

    @property
    def right(self) -> np.ndarray:
        """Which test samples the last model has right, bool [n_test]."""
        return np.equal(self.predicted, self.test_labels)


def to_line(record: Record) -> str:
    """A record as a line of JSON.

    Raises:
        TypeError: for a value that JSON does not have.
    """
    return msgspec.json.encode(record, enc_hook=_packed).decode()


def from_line(line: bytes) -> Finished | Measurement | Unfinished:
    """The record in a line; a ValueError names the key that is wrong."""
    return _DECODER.decode(line)


def _packed(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return pack_labels(value)
    raise TypeError(f"record: expected plain values, found {type(value).__name__}")


def _unpacked(kind: type, value: Any) -> np.ndarray:
    if isinstance(value, str):
        return unpack_labels(value)
    raise ValueError(f"expected packed labels, found {value!r}")


_DECODER = msgspec.json.Decoder(Finished | Measurement | Unfinished, dec_hook=_unpacked)


def name_of(
    name: str,
    config: Mapping[str, Any],
    data: str,
) -> str:
    """Name of a record: what it is, and a hash of everything that determines it."""
    return f"{name}-{digest_of([config, data])}"


def digest_of(value: Any) -> str:
    """12 hexadecimal digits that tell JSON values apart."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def current_steps() -> list[str]:
    """The step that this process belongs to, if it belongs to one."""
    step = os.environ.get(STEP)
    return [step] if step else []
