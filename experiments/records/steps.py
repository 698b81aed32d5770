"""Which records belong to a step of the reproduction: a list a step, in ``steps/`` of own results.

The runner of the steps names a file in :data:`VARIABLE`; every run and measurement of the step,
made or found finished, adds its name there, in workers of a launcher too. It takes the place of the
step's list once the step is finished: a later call that breaks off leaves that list as it was.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

VARIABLE = "EXPERIMENTS_STEP"
FOLDER = "steps"


def place(results: Path, mode: str, step: str) -> Path:
    """The list of the last call of a step that was finished."""
    return results / FOLDER / mode / f"{step}.txt"


def begin(path: Path) -> Path:
    """Begin the list of a call of the step whose list is `path`; returns where it is."""
    begun = _begun(path)
    begun.parent.mkdir(parents=True, exist_ok=True)
    begun.write_text("", encoding="utf-8")
    return begun


def finish(path: Path) -> None:
    """Make the list of a call that :func:`begin` began the list of its step."""
    _begun(path).replace(path)


def _begun(path: Path) -> Path:
    return path.with_suffix(".begun")


def add(name: str) -> None:
    """Add a record to the list of the step that this process belongs to, if there is one."""
    path = os.environ.get(VARIABLE)
    if path:
        with open(path, "a", encoding="utf-8") as file:  # one write: lines stay whole
            file.write(f"{name}\n")


class Listed(NamedTuple):
    """The names of records in a list; `whole` if its call was finished, not if it broke off or is
    under way."""

    mode: str
    step: str
    names: set[str]
    whole: bool


def read(results: Path) -> Iterator[Listed]:
    """Every list."""
    for path in sorted((results / FOLDER).glob("*/*")):
        if path.suffix in (".txt", ".begun"):
            names = set(path.read_text(encoding="utf-8").split())
            whole = path.suffix == ".txt"
            yield Listed(path.parent.name, path.stem, names, whole)
