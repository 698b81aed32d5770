"""Extreme inputs by the obvious implementation and by ours, against an exact reference."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.limits.stability.case import CASES
from experiments.studies.limits.stability.cases import (  # noqa: F401  (their cases register themselves)
    correlations,
    counting,
    encoders,
    readouts,
    sensor,
    training,
)


@experiment(revision=3)
def stability(run: Run) -> Iterator[Row]:
    """One row: a case, with the errors of both computations."""
    for case in CASES:
        row = case.row()
        run.note(f"{row['verdict']}: {case.name}")
        yield row
