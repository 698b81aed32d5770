"""Extreme inputs by the obvious implementation and by ours, against an exact reference.

Encoders, counters, read-outs and training have a file of cases each.
"""

from __future__ import annotations

from collections.abc import Iterator

from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.limits.stability import counting, encoders, readouts, training

CASES = [*counting.CASES, *encoders.CASES, *readouts.CASES, *training.CASES]


@experiment(revision=5)
def stability(run: Run) -> Iterator[Row]:
    """One row: a case, with the errors of both computations."""
    for case in CASES:
        row = case.row()
        run.note(f"{row['verdict']}: {case.case}")
        yield row
