"""Numbers at their limits: every case the obvious way and ours, against an exact reference."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.stability.case import CASES
from experiments.studies.stability.cases import (  # noqa: F401  (their cases register themselves)
    correlations,
    hypervectors,
    layer,
    training,
)


PARTS = ("hypervectors", "correlations", "training", "layer")


@experiment
def stability(
    run: Run, repeats: int = 5, budget_s: float = 1.0, small: bool = False
) -> Iterator[Row]:
    """One row: a case, with the errors and times of both computations.

    Args:
        repeats: the most that each computation is timed.
        budget_s: neither is timed again once both took this long together.
        small: the cases' small sizes, for a quick look.
    """
    for case in sorted(CASES, key=lambda case: PARTS.index(case.part)):
        row = case.row(repeats, budget_s, small)
        run.note(f"{row['verdict']}: {case.name}")
        yield row
