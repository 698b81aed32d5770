"""The settings of a recording, as every reader takes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple


class Asked(NamedTuple):
    """Settings of a recording; see :func:`hdc.readers.open_recording`.

    Attributes:
        labels: name of the array of labels.
        table: a CSV.
        values: columns or arrays that are values; None means all numbers.
        sessions, groups: names of the columns or arrays that are these.
        dataset: name of the array of frames; "" where the file has one that can be.
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

    def of_part(self) -> Asked:
        """The same of one of several files or arrays, which may have neither labels nor values."""
        own = self._replace(template=None, sessions=None, groups=None, values=())
        return own._replace(fewest_classes=0)

    @property
    def named(self) -> Sequence[str]:
        """The values that are named."""
        return self.values or ()
