"""What every record has, of a run or of a measurement: config, data, revisions, and when it counts.

A record is named after its config and a digest of its data: made again by other revisions it takes
the place of the one before.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Literal

import msgspec

from experiments.records import revision
from experiments.records.environment import Environment, changes
from experiments.records.revision import Revisions

SCHEMA = 4


class Entry(msgspec.Struct, kw_only=True):
    """What runs and measurements have in common.

    Attributes:
        id: names it; a hash of config and data is part of it.
        status: ``finished``, ``failed`` or ``interrupted``.
        config: everything that determines it, resolved, as Hydra composed it.
        data: digest of everything that determines its frames.
        revisions: of all that took part, by name.
        changed: values of the config that are not those of the files it was composed from, by key,
            as JSON; but for seeds.
        environment: machine, libraries and commit.
        command: that a user typed.
    """

    schema: Literal[4]
    id: str
    status: str
    config: dict[str, Any]
    data: str = ""
    revisions: Revisions
    changed: dict[str, str] = {}
    environment: Environment
    command: str = ""

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
