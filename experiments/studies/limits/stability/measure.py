"""Extreme inputs by the obvious implementation and by ours, against an exact reference."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from experiments.protocol.task import Context, Row, Task
from experiments.studies.limits.stability.case import CASES
from experiments.studies.limits.stability.cases import (  # noqa: F401  (their cases register themselves)
    correlations,
    counting,
    encoders,
    readouts,
    sensor,
    training,
)


class Stability(Task, frozen=True):
    """One row: a case, with the errors of both computations."""

    revision: ClassVar = 3

    def rows(self, context: Context) -> Iterator[Row]:
        for case in CASES:
            row = case.row()
            context.note(f"{row['verdict']}: {case.name}")
            yield row
