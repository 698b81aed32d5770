"""A record: what was carried out, the rows that it gave, by which code and on which machine.

An experiment's rows are all that it yields. A training is an experiment, too; its rows are its
checkpoints, and its results are the last row (:class:`experiments.protocol.measure_run.Training`).
The name of a record is written when it is made, so reading it needs neither configs nor Hydra. The
name has a hash of config and data; a record that other code makes again replaces the earlier one.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any, Literal

import msgspec

from experiments.records import revision
from experiments.records.environment import Environment, changes
from experiments.records.revision import Revisions
from experiments.records.rows import Row, Rows, unpack_labels
from hdc.accuracy import accuracy

SCHEMA: Literal[6] = 6
# Keys of a training's config that every reader counts on.
_NEEDED = (("seed", "run"), ("split", "n_train"), ("data", "pixels"))


class Named(msgspec.Struct, frozen=True, omit_defaults=True):
    """A scene or a model.

    Attributes:
        name: of its config.
        label: its name, and in brackets what was changed of it.
        display: how its config wants it shown: its name, its place in an order …
    """

    name: str
    label: str
    display: dict[str, Any] = {}


class Record(msgspec.Struct, kw_only=True, omit_defaults=True):
    """Everything that is known of one call of an experiment.

    Attributes:
        id: names it; a hash of config and data is part of it.
        experiment: name of the config of the experiment; of a training, that of its sweep, if any.
        task: dotted name of what made the rows; of a training, nothing.
        scene, model: by their configs; only a training has one model.
        stop: of a training, name of the config of its stopping rule.
        config: everything that determines the rows, resolved, as Hydra composed it.
        changed: values that the command line or the file of an experiment set, by key, as JSON; but
            for seeds, and for what a table asks for by number.
        timed: whether its rows have times; ``environment`` says whether it had the machine alone.
        command: that a user typed.
        data: digest of everything that determines its frames.
        revisions: of all that took part, by name.
        environment: machine, libraries and commit.
        status: ``finished``, ``failed`` or ``interrupted``; ``error`` says why.
        seconds: of making the rows.
        rows: as many as there came to be.

    Raises:
        ValueError: for a training without what every training has, or whose predictions are not one
            a test sample, each one of the classes, or do not give the accuracy that is stated.
    """

    schema: Literal[6]
    id: str
    experiment: str = ""
    task: str = ""
    scene: Named | None = None
    model: Named | None = None
    stop: str = ""
    config: dict[str, Any]
    changed: dict[str, str] = {}
    timed: bool = False
    command: str = ""
    data: str = ""
    revisions: Revisions
    environment: Environment
    status: str = "finished"
    error: str | None = None
    seconds: float | None = None
    rows: Rows = Rows()

    def __post_init__(self) -> None:
        if not self.is_training:
            return
        for group, key in _NEEDED:
            part = self.config.get(group)
            if not isinstance(part, Mapping) or key not in part:
                raise ValueError(f"config.{group}.{key}: expected a value, found none")
        if self.is_finished:
            _check(self.results)

    @property
    def is_finished(self) -> bool:
        """Whether its rows are all that there are."""
        return self.status == "finished"

    @property
    def is_training(self) -> bool:
        """Whether it is the training of one model."""
        return self.model is not None

    @property
    def curve(self) -> list[Row]:
        """The checkpoints of a training, each without what was not reported."""
        reported = (
            row for row in self.rows.dicts() if row.get("training_s") is not None
        )
        return [{k: v for k, v in row.items() if v is not None} for row in reported]

    @property
    def results(self) -> Row:
        """The last row of a finished training."""
        if not (self.is_training and self.is_finished and self.rows.values):
            return {}
        of_curve = {key for row in self.curve for key in row}
        last = self.rows.dicts()[-1]
        return {key: value for key, value in last.items() if key not in of_curve}

    @property
    def outdated(self) -> list[str]:
        """Why it would be made again today: what has another revision, or other changes."""
        return self.differs_from(revision.of_today(self.revisions))

    def differs_from(self, now: Revisions) -> list[str]:
        """Parts of the code that differ from these revisions, or lie in no commit."""
        others = revision.outdated(self.revisions, now)
        made_with = self.environment.changes
        if made_with is not None and made_with != changes():
            others.append("changes of a checkout that are in no commit")
        return others


def _check(results: Row) -> None:
    """Refuse results that contradict themselves."""
    try:
        n, classes = results["n_test"], results["n_classes"]
        stated = results["test_accuracy_final"]
        texts = {name: results[name] for name in ("labels", "predicted")}
    except KeyError as error:
        raise ValueError(f"results: expected {error}, found none") from None
    found = {name: unpack_labels(text) for name, text in texts.items()}
    for name, labels in found.items():
        most = labels.max(initial=0)
        if len(labels) != n or labels.min(initial=0) < 0 or most >= classes:
            expected = f"{n} labels from 0 to {classes - 1}"
            raise ValueError(
                f"{name}: expected {expected}, found {len(labels)} to {most}"
            )
    share = accuracy(found["predicted"], found["labels"])
    if not math.isclose(stated, share, abs_tol=1e-9):
        expected = f"{share:.6f} of the predictions beside it"
        raise ValueError(f"test_accuracy_final: expected {expected}, found {stated}")


def name_of(name: str, config: Mapping[str, Any], data: str) -> str:
    """Name of a record: what it is, and a hash of everything that determines it."""
    text = json.dumps([config, data], sort_keys=True, default=str)
    return f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"
