"""Extreme inputs by the naive implementation and by ours, against an exact reference.

Each case is a row: an input, the naive computation, ours, and what is right. Encoders, counters,
read-outs and training have a file of rows each, next to the definitions that say what is right.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from experiments.protocol.task import Context, Row, Task
from experiments.studies.limits.stability import counting, encoders, readouts, training

CASES = [*counting.CASES, *encoders.CASES, *readouts.CASES, *training.CASES]


class Stability(Task, frozen=True):
    """One row: a case, with the errors of both computations."""

    revision: ClassVar = 5

    def rows(self, context: Context) -> Iterator[Row]:
        for case in CASES:
            row = case.row()
            context.note(f"{row['verdict']}: {case.case}")
            yield row
