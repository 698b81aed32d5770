"""Every model on public recordings: tables, figures, and what claims rest on."""

from experiments.reporting.measured import RIVAL

# Tables and figures are shown in the order in which these modules register them.
from experiments.studies.recordings import forest, tables

# isort: split
from experiments.studies.recordings import decomposition, figures

# isort: split
from experiments.studies.recordings import costs, theory
from experiments.studies.recordings.study import STUDY
from experiments.studies.recordings.values import (
    CONFIRMATORY,
    RIVALS,
    Accuracies,
    over_rival,
    recordings,
    unsaturated,
)

__all__ = [
    "CONFIRMATORY",
    "RIVAL",
    "RIVALS",
    "STUDY",
    "Accuracies",
    "costs",
    "decomposition",
    "figures",
    "forest",
    "over_rival",
    "recordings",
    "tables",
    "theory",
    "unsaturated",
]
