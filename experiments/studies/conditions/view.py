"""What would have to be true for Table I: every part's tables and figures."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.records.results import Results
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table
from experiments.studies.conditions import view_linear, view_optics

PARTS = (view_linear, view_optics)


def tables(results: Results) -> Iterator[Table]:
    """Those of every part."""
    for part in PARTS:
        yield from part.tables(results)


def plots(results: Results) -> Iterator[Plot]:
    """Those of every part."""
    for part in PARTS:
        yield from part.plots(results)


STUDY = Study(
    "conditions",
    "What would have to be true for Table I",
    "The paper gives the learning rate, and neither the optimiser, the initial weights, the scale "
    "of the pixels nor when training was stopped. What brings about the published row, with HDC on "
    "the same frames, and does the pattern go where its cause is removed?",
    1.5,
    tables,
    plots,
    front=True,
)
