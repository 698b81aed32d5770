"""Columns of tables: one entry a quantity, with its head, how it is shown, and a note.

A table shows a column ``x`` that has ``x_low`` and ``x_high`` beside it as one cell,
``value [low, high]``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from experiments.records import configs
from experiments.reporting.text import number, percent, points, size

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """How a quantity is shown.

    Attributes:
        head: of the column, with its unit.
        show: text of a value; a missing value is shown as a dash.
        note: what a reader has to know to read it, a sentence.
        cell: text of a whole row, for a cell that several values make; replaces `show`.
        of_machine: whether it belongs to the machine, as seconds do, so that numbers of two
            machines do not compare.
    """

    head: str
    show: Callable[[Any], str] = number
    note: str = ""
    cell: Callable[[Row], str] | None = None
    of_machine: bool = False

    def text(self, name: str, row: Row) -> str:
        """The cell of a row."""
        if self.cell is not None:
            return self.cell(row)
        value = row.get(name)
        low = row.get(f"{name}_low")
        high = row.get(f"{name}_high")
        if value is None:
            return "–"
        if low is None or high is None:
            return self.show(value)
        return f"{self.show(value)} [{self.show(low)}, {self.show(high)}]"


def display_name(model: str) -> str:
    """Name of a model in tables and figures; changed settings stand in brackets."""
    name, changed, rest = model.partition(" (")
    return configs.display(name)["name"] + changed + rest


def scene_name(scene: str) -> str:
    """Name of a scene in tables and figures; changed settings stand in brackets."""
    name = re.match(r"[\w.-]*", scene)[0]  # type: ignore[index]  # matches any text
    shown = configs.scene_display(name)["name"]
    return f"{shown}{scene.removeprefix(name)}"


def milliseconds(seconds: float) -> str:
    """Seconds as milliseconds."""
    return number(1e3 * seconds)


def _pixels(count: Any) -> str:
    return count if isinstance(count, str) else f"{int(count):,}"


COLUMNS: dict[str, Column] = {
    # Of runs.
    "scene": Column("Scene", scene_name),
    "model": Column("Model", display_name),
    "n_train": Column("N"),
    "pixels": Column("D", _pixels),
    "seeds": Column("Seeds"),
    "training_time_s": Column(
        "Training time, s",
        note="Training time: iterative models, until training accuracy exceeds 90 %; one-pass "
        "models, until fitted. Median over seeds; empty where runs were timed beside others.",
        of_machine=True,
    ),
    "test_accuracy_final": Column(
        "Test accuracy, % [95 %]",
        percent,
        note="95 % intervals: Student over seeds, never narrower than the test set allows; Wilson "
        "for one seed or one data set.",
    ),
    "over_hdc": Column(
        "Difference from HDC, points [95 %]",
        points,
        note="Difference from HDC: paired by seed on the same test samples; above zero, the model "
        "is more accurate.",
    ),
    "model_bytes": Column("Size", size),
    "predict_single_s": Column(
        "Prediction, ms per frame", milliseconds, of_machine=True
    ),
    "origin": Column("Frames"),
    # Of measurements.
    "accuracy": Column("Accuracy, %", percent),
    "test_accuracy": Column("Test accuracy, %", percent),
    "train_accuracy": Column("Training accuracy, %", percent),
    "seconds": Column("Time, s", of_machine=True),
}
