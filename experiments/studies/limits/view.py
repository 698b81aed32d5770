"""Extreme inputs, error against run time, stiffness: each module registers its tables and figures,
shown in this order."""

from experiments.studies.limits.stability import view as _stability  # noqa: F401

# isort: split
from experiments.studies.limits.numerics import view as _numerics  # noqa: F401

# isort: split
from experiments.studies.limits.stiffness import view as _stiffness  # noqa: F401
from experiments.studies.limits.study import STUDY

__all__ = ["STUDY"]
