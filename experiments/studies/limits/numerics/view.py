"""Error and run time of the numerics."""

from __future__ import annotations

from experiments.reporting.columns import Column, milliseconds
from experiments.reporting.table import Table

NAMES = ["input", "method", "number", "error", "tolerance", "time_s", "verdict"]


TABLE = Table(
    "numerics",
    lambda frame: frame[NAMES],
    of="numerics",
    title="Error and time of phases and of mean correlations. {machine}",
    columns={
        "number": Column("Precision"),
        "time_s": Column("CPU time, ms", milliseconds, of_machine=True),
    },
    note="Phases: the camera's frame of 62,856 paths, error in mean intensities. Precision: "
    "of the phases. Verdict: of what this project uses; it holds if its error is within the "
    "tolerance.",
)
