"""Every model on public recordings: each module registers its tables and figures."""

from experiments.studies.recordings import (  # noqa: F401
    costs,
    decomposition,
    figures,
    forest,
    tables,
    theory,
)
from experiments.studies.recordings.study import STUDY

__all__ = ["STUDY"]
