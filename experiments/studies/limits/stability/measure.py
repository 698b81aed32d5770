"""Extreme inputs by the naive implementation and by ours, against an exact reference.

Each case is a row: an input, the naive computation, ours, and what is right. Encoders, counters,
read-outs, sums and training have a file of rows each, next to the definitions that say what is
right.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from threadpoolctl import threadpool_limits

from experiments.protocol.task import Context, Row, Task
from experiments.studies.limits.stability import (
    counting,
    encoders,
    readouts,
    sums,
    training,
)

FAMILIES = (counting, encoders, readouts, sums, training)
CASES = [case for family in FAMILIES for case in family.CASES]


class Stability(Task, frozen=True):
    """One row: a case, with errors and CPU times of both computations."""

    revision: ClassVar = 6

    def rows(self, context: Context) -> Iterator[Row]:
        with threadpool_limits(1):  # waiting threads would count as CPU time
            for case in CASES:
                row = case.row()
                context.note(f"{row['verdict']}: {case.case}")
                yield row
