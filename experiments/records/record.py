"""A record: what an experiment was, the rows that came of it, by which code and on which machine.

A measurement is an experiment whose rows are all that it yields. A run, the training of one model
(:mod:`experiments.records.run`), is an experiment as well: its rows are its curve, and it has
results besides. A record is named after its config and a digest of its data. Made again by other
code it takes the place of the one before.
"""

from __future__ import annotations

import functools
import hashlib
import json
import shlex
from collections.abc import Mapping
from typing import Any, Literal

import msgspec
import numpy as np

from experiments.records import names, revision
from experiments.records.configs import SEEDS
from experiments.records.environment import Environment, changes
from experiments.records.revision import Revisions
from experiments.records.rows import Rows, pack_labels

SCHEMA: Literal[5] = 5
# Keys of a config that say how a run is carried out, or how it is shown, not what it computes.
NOT_IDENTITY = (
    *("force", "cache", "exclusive", "task", "beside", "display", "scene_display"),
    "sessions",  # what the scene is made of, and has in itself
)
# Arguments of an experiment that say which frames there are.
_OF_FRAMES = ("scene", "split", "old_split")


class Record(msgspec.Struct, kw_only=True, omit_defaults=True, dict=True, eq=False):
    """Fields of every record.

    Attributes:
        id: names it; a hash of config and data is part of it.
        command: that a user typed.
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
        return self.differs_from(revision.of_today(self.revisions))

    def differs_from(self, now: Revisions) -> list[str]:
        """What of the code differs from these revisions, or lies in no commit."""
        names = revision.outdated(self.revisions, now)
        made_with = self.environment.changes
        if made_with is not None and made_with != changes():
            names.append("changes of a checkout that are in no commit")
        return names


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

    def __post_init__(self) -> None:
        _ = self.scene_label  # a command with an open quote is no record

    @functools.cached_property
    def scene_label(self) -> str:
        """Name of the scene's config, and what the command line changed of it, but for seeds."""
        changed = {}
        for word in shlex.split(self.command):
            key = word.partition("=")[0].lstrip("+~")
            is_seed = key.rpartition(".")[2] in SEEDS
            if key.startswith("scene.") and not is_seed:
                changed[key] = json.dumps(_at(self.config, key))
        return labelled(self.scene, changed)

    @property
    def of_other_frames(self) -> bool:
        """Whether its frames, or which of them test, are not those of the experiment's config."""
        return any(key.partition(".")[0] in _OF_FRAMES for key in self.changed)


def to_line(record: Record) -> str:
    """A record as a line of JSON.

    Raises:
        TypeError: for a value that JSON does not have.
    """
    return msgspec.json.encode(record, enc_hook=_packed).decode()


def _packed(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return pack_labels(value)
    raise TypeError(f"record: expected plain values, found {type(value).__name__}")


def labelled(name: str, changed: Mapping[str, str]) -> str:
    """A name, and in brackets what was changed."""
    values = [f"{key.partition('.')[2]}={value}" for key, value in changed.items()]
    return f"{name} ({', '.join(values)})" if values else name


def _at(config: Any, key: str) -> Any:
    """The value of a dotted key, in which a number is a place of a list; None where none is."""
    for part in key.split("."):
        if isinstance(config, list):
            config = {str(place): value for place, value in enumerate(config)}
        config = config.get(part) if isinstance(config, Mapping) else None
    return config


def name_of(
    name: str,
    config: Mapping[str, Any],
    data: str,
) -> str:
    """Name of a record: what it is, and a hash of everything that determines it."""
    return f"{name}-{digest_of([names.of_version_3_0(config), data])}"


def digest_of(value: Any) -> str:
    """12 hexadecimal digits that tell JSON values apart."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
