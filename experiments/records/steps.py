"""Which records belong to a step of the reproduction: a list a step, in ``steps/`` of own results.

The runner of the steps names a file in :data:`VARIABLE`; every run and measurement of the step,
made or found finished, adds its name there, in workers of a launcher too.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "EXPERIMENTS_STEP"
FOLDER = "steps"


def place(results: Path, mode: str, step: str) -> Path:
    """The list of a step."""
    return results / FOLDER / mode / f"{step}.txt"


def begin(path: Path) -> None:
    """Begin the list of a step anew."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("", encoding="utf-8")


def add(name: str) -> None:
    """Add a record to the list of the step that this process belongs to, if there is one."""
    path = os.environ.get(VARIABLE)
    if path:
        with open(path, "a", encoding="utf-8") as file:  # one write: lines stay whole
            file.write(f"{name}\n")


def read(results: Path) -> Iterator[tuple[str, str, set[str]]]:
    """Mode, step and names of records of every list."""
    for path in sorted((results / FOLDER).glob("*/*.txt")):
        names = path.read_text(encoding="utf-8").split()
        yield path.parent.name, path.stem, set(names)
