"""Which models Table I has, and on which scene."""

from __future__ import annotations

from experiments.records import configs
from experiments.reporting import published
from experiments.reporting.measured import RIVAL

PAPER = published.models_of_table1()
LINES = (*PAPER, RIVAL)


def scene() -> str:
    """Name of the scene of Table I."""
    return configs.sweep("table1")["scene"][0]
