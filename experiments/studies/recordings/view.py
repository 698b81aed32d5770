"""Every model on public recordings: each module registers its tables and figures, shown in this
order."""

from experiments.studies.recordings import forest, tables  # noqa: F401

# isort: split
from experiments.studies.recordings import costs, decomposition, peers  # noqa: F401
from experiments.studies.recordings.study import STUDY

__all__ = ["STUDY"]
