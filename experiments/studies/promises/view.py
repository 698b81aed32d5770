"""Values, label sets and probabilities: each module registers its tables and figures, shown in this
order."""

from experiments.studies.promises.values import view as _values  # noqa: F401

# isort: split
from experiments.studies.promises.calibration import view as _calibration  # noqa: F401
from experiments.studies.promises.study import STUDY

__all__ = ["STUDY"]
