"""Every model on public recordings."""

from experiments.reporting.study import Study
from experiments.studies.recordings import (
    costs,
    decomposition,
    forest,
    tables,
)

STUDY = Study(
    "recordings",
    "Public recordings",
    "On frames of optical sensors of several kinds, captured or computed by others: does HDC "
    "recognise better than its rivals, and what wins back what it loses?",
    0.5,
    front=True,
    tables=[
        *tables.TABLES,
        *decomposition.TABLES,
        *costs.TABLES,
    ],
    figures=[*forest.FIGURES, *decomposition.FIGURES, *costs.FIGURES],
)
