"""Which models Table I has, and on which scene."""

from __future__ import annotations

from typing import Any

from experiments.records import configs
from experiments.reporting import published
from experiments.reporting.resamples import RIVAL

PAPER = published.models_of_table1()
DESCENT = "softmax_descent"  # another recipe for the paper's softmax row
_PAPERS_ROW = {DESCENT: "softmax"}
_AT = PAPER.index("softmax") + 1
LINES = (*PAPER[:_AT], DESCENT, *PAPER[_AT:], RIVAL)


def scene() -> str:
    """Name of the scene of Table I."""
    return configs.sweep("table1")["scene"][0]


def papers_row(model: str) -> str:
    """The row of the paper's Table I that a model repeats: its own, or that of its recipe."""
    return _PAPERS_ROW.get(model, model)


def papers_numbers(model: str) -> dict[str, Any]:
    """Training time, absolute and relative to HDC, and test accuracy in the row of the paper's
    Table I; None where it has none."""
    row = f"table1/{papers_row(model)}"
    time = published.value(f"{row}_training_time")
    hdc = published.value("table1/hdc_training_time")
    return {
        "published_training_time_s": time,
        "published_training_time_over_hdc": time / hdc if time and hdc else None,
        "published_test_accuracy": published.value(f"{row}_test_accuracy"),
    }


def papers_training_accuracy(model: str) -> float | None:
    """The training accuracy that the paper gives for a model, a fraction; None without one."""
    return published.value(f"table1/{papers_row(model)}_training_accuracy")
