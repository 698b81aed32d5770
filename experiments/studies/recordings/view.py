"""Every model on public recordings: tables, figures, and what claims rest on."""

from experiments.reporting.measured import RIVAL
from experiments.studies.recordings import (
    costs,
    decomposition,
    figures,
    forest,
    tables,
    theory,
)
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
