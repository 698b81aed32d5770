"""The record of a run: the training of one model on a scene, and how tables name it."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from experiments.records import configs
from experiments.records.record import Record, labelled
from hdc.accuracy import accuracy

# Keys of a config that whoever reads a run counts on.
_GROUPS = ("scene", "model", "stop", "split", "data", "seed")
# What a row asks for by number; and where a recording lies, which is known by its content.
COORDINATES = ("split.n_train", "data.pixels", "scene.path")
# Of what was changed.
_FRAMES_FIRST = {"scene": 0, "split": 1, "model": 2, "stop": 3}
_OF_MODEL = ("model.", "stop.")  # keys of what was changed of a model, not of a scene

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


class RunRecord(Record, kw_only=True, omit_defaults=True):
    """Fields of every record of a run.

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
    overrides: list[str] = msgspec.field(default_factory=list)
    display: dict[str, Any] = msgspec.field(default_factory=dict)
    scene_display: dict[str, Any] = msgspec.field(default_factory=dict)
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
        beside_s: seconds of training of other models on the same frames, by name: the mean of one
            just before and one just after.
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
    beside_s: dict[str, float] = msgspec.field(default_factory=dict)
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
            if len(labels) and not 0 <= labels.min() <= labels.max() < classes:
                limits = f"{labels.min()} to {labels.max()}"
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

    @property
    def seeds(self) -> str:
        """Its seeds, as text: runs of several models with equal ones saw the same samples."""
        return json.dumps(self.config["seed"], sort_keys=True)

    @property
    def iterative(self) -> bool:
        """Whether the model learns by steps that report a loss, or in one pass."""
        return any("loss" in row for row in self.curve)

    @property
    def time_to_90_s(self) -> float:
        """Training time in the paper's sense, in seconds: of a model that learns by steps until its
        training accuracy exceeded 90 % (infinite if it never did), of one that is solved, or learns
        in one pass, until it is done."""
        if not self.iterative:
            return self.training_s
        if self.time_to_target_train_s is not None:
            return self.time_to_target_train_s
        # One report without steps of an optimiser: a solver that goes to the optimum.
        once = len(self.curve) == 1 and "steps" not in self.curve[0]
        solved = once and self.stop == "finished"
        return self.training_s if solved else math.inf

    @property
    def every_seed(self) -> str:
        """Every seed in its config, in the order of the keys, as text."""
        return json.dumps(list(_seeds(self.config)))

    @property
    def made_by(self) -> str:
        """Revisions of its code, as text."""
        return json.dumps(self.revisions, sort_keys=True)

    @functools.cached_property
    def differences(self) -> dict[str, str]:
        """Values of its scene, split, model and stop that differ from ``configs/``, by key, but for
        where it stands in a sweep. What learns in one pass has no stopping rule."""
        found = {}
        for key in sorted(self.changed, key=_order_of_key):
            of_stop = key.startswith("stop.") and not self.iterative
            if key not in COORDINATES and not of_stop:
                found[key] = self.changed[key]
        return found

    @property
    def scene_label(self) -> str:
        """Name of the scene's config, for a recording with its fingerprint, and what differs."""
        differing = self.differences.items()
        changed = {key: v for key, v in differing if not key.startswith(_OF_MODEL)}
        name = self.scene.name
        if self.scene.origin == "recorded":
            path = Path(str(self.config["scene"].get("path", "")))
            name += f" {path.name} ({self.data[:6]})"
        return labelled(name, changed)

    @property
    def model_label(self) -> str:
        """Name of the model's config, and what differs of it and of the stopping rule."""
        differing = self.differences.items()
        changed = {key: v for key, v in differing if key.startswith(_OF_MODEL)}
        return labelled(self.choices.model, changed)

    @property
    def configuration(self) -> str:
        """All of the config that runs of one row have in common, as text."""
        config = _core(self.config)
        if not self.iterative:  # it ends by itself, whatever the rule
            config.pop("stop")
        for name in COORDINATES:
            group, key = name.split(".")
            config[group].pop(key, None)
        return json.dumps(config, sort_keys=True)


def _order_of_key(key: str) -> int:
    group, _, _ = key.partition(".")
    return _FRAMES_FIRST.get(group, 4)


def _seeds(config: Any) -> Iterator[Any]:
    if isinstance(config, Mapping):
        for key in sorted(config):
            if key in configs.SEEDS:
                yield config[key]
            else:
                yield from _seeds(config[key])
    elif isinstance(config, list | tuple):
        for part in config:
            yield from _seeds(part)


def _core(config: Any) -> Any:
    """A config without what differs from seed to seed, or from device to device."""
    return configs.without((*configs.SEEDS, "device"), config)
