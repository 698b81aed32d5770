"""The settings of a recording, as every reader takes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple


class Asked(NamedTuple):
    """Settings of a recording; see :func:`hdc.readers.open_recording`.

    Attributes:
        labels: name of the array or column of labels.
        table: a CSV.
        values: columns or arrays that are values; None means all numbers.
        sessions, groups: names of the columns or arrays that are these.
        dataset: name of the array of frames; "" where the file has one that can be.
        frames: how many of each file of a folder, evenly spaced; None means all.
    """

    labels: str | None = None
    table: Path | None = None
    values: Sequence[str] | None = ()
    sessions: str | None = None
    groups: str | None = None
    fewest_classes: int = 2
    axes: Sequence[str] | None = None
    dataset: str = ""
    template: str | None = None
    image_column: str = "image"
    skip_damaged: bool = False
    skip_missing: bool = False
    frames: int | None = None
    check: bool = True
    memory_bytes: int = 2**28

    def within(self, group: str) -> Asked:
        """The same of a file whose arrays are known by their names in a group."""
        names = {name: getattr(self, name) for name in ("labels", "sessions", "groups")}
        known = {k: name and name.removeprefix(group) for k, name in names.items()}
        return self._replace(**known)

    def of_part(self) -> Asked:
        """The same of one of several files or arrays, which may have neither labels nor values."""
        return self._replace(template=None, frames=None, fewest_classes=0)

    @property
    def named(self) -> Sequence[str]:
        """The values that are named."""
        return self.values or ()
