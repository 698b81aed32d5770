"""Columns of tables: one entry a quantity, with its head, how it is shown, a note, and how it
follows from runs: times are medians over seeds, accuracies means.

A table shows a column ``x`` that has ``x_low`` and ``x_high`` beside it as one cell,
``value [low, high]``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.records import configs
from experiments.records.groups import Group
from experiments.reporting import estimates
from experiments.reporting.text import kind_of, number, percent, points, size

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """How a quantity is shown.

    Attributes:
        head: of the column, with its unit.
        show: text of a value; a missing value is shown as a dash.
        note: what a reader has to know to read it, a sentence.
        of: its value in a row of runs, from their group and the group of HDC on the same frames; an
            :class:`estimates.Estimate` fills ``x``, ``x_low`` and ``x_high``.
        cell: text of a whole row, for a cell that several values make; replaces `show`.
    """

    head: str
    show: Callable[[Any], str] = number
    note: str = ""
    of: Callable[[Group, Group], Any] | None = None
    cell: Callable[[Row], str] | None = None

    def text(self, name: str, row: Row) -> str:
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


def model_columns(
    models: Iterable[str],
    unit: str,
    show: Callable[[Any], str],
) -> dict[str, Column]:
    """A column for each model, with its name and the unit as its head."""
    return {model: Column(f"{display_name(model)}{unit}", show) for model in models}


def milliseconds(seconds: float) -> str:
    return number(1e3 * seconds)


def same(values: Iterable[Any]) -> Any:
    """The value that all have, or ``mixed``."""
    distinct = set(values)
    return distinct.pop() if len(distinct) == 1 else "mixed"


def _mean(key: str) -> Callable[[Group, Group], float | None]:
    def mean(group: Group, _: Group) -> float | None:
        values = [getattr(run, key) for run in group.runs]
        known = [value for value in values if value is not None]
        return float(np.mean(known)) if known else None

    return mean


def _median(key: str) -> Callable[[Group, Group], float]:
    def median(group: Group, _: Group) -> float:
        values = [getattr(run, key) for run in group.runs]
        return float(np.median(values))

    return median


def _same(get: Callable[[Any], Any]) -> Callable[[Group, Group], Any]:
    def of_all(group: Group, _: Group) -> Any:
        return same(get(run) for run in group.runs)

    return of_all


def _training_time(group: Group, _: Group) -> float | str:
    """Median of the training times; a text where that run never reached 90 %."""
    times = [estimates.training_time(run) for run in group.runs]
    seconds = float(np.median(times))
    longest = max(run.training_s for run in group.runs)
    return seconds if math.isfinite(seconds) else f"not reached in {longest:.3g} s"


def _over_hdc(group: Group, hdc: Group) -> float | None:
    """Training time relative to HDC with the same seeds, median over runs; on one processor."""
    if group.machines != hdc.machines or len(group.machines) != 1:
        return None
    reference = {run.seeds: estimates.training_time(run) for run in hdc.runs}
    ratios = []
    for run in group.runs:
        if run.seeds in reference:
            time = estimates.training_time(run)
            ratios.append(time / reference[run.seeds])
    ratio = float(np.median(ratios)) if ratios else math.inf
    return ratio if math.isfinite(ratio) else None


def _difference(group: Group, hdc: Group) -> estimates.Estimate | None:
    if group.model == "hdc":
        return None
    return estimates.difference(group.runs, hdc.runs)


def _kind(group: Group, _: Group) -> str:
    """The kind of the frames; of a scene whose parameters were chosen by HDC's own accuracy, so."""
    kind = same(kind_of(run.scene.origin) for run in group.runs)
    fitted = configs.scene_display(group.scene)["fitted"]
    return f"{kind}, fitted to the accuracy of HDC" if fitted else str(kind)


def _status(row: Row) -> str:
    parts = [row.get("status"), row.get("stop")]
    return ", ".join(filter(None, parts))


# fmt: off
COLUMNS: dict[str, Column] = {
    # Of runs, in the order of the CSV.
    "scene": Column("Scene", of=lambda group, _: group.scene),
    "model": Column("Model", display_name, of=lambda group, _: group.model),
    "n_train": Column("N", of=lambda group, _: group.runs[0].n_train),
    "pixels": Column("D", show=lambda d: d if isinstance(d, str) else f"{int(d):,}",
        of=lambda group, _: group.pixels or math.prod(group.runs[0].scene.shape)),
    "seeds": Column("Seeds", of=lambda group, _: len(group.runs)),
    "stop": Column("Stop",
        of=lambda group, _: "; ".join(sorted({run.stop for run in group.runs}))),
    "status": Column("Status", of=lambda group, _: group.status, cell=_status),
    "training_time_s": Column("Training time, s", of=_training_time,
        note="Training time: iterative models, until training accuracy exceeds 90 %; one-pass "
        "models, until fitted. Median over seeds."),
    "total_time_s": Column("Until it stopped, s", of=_median("training_s")),
    "training_time_over_hdc": Column("× HDC", of=_over_hdc),
    "train_accuracy_at_target": Column("Training accuracy at 90 %, %", percent,
        of=_mean("train_accuracy_at_target")),
    "test_accuracy_at_target": Column("Test accuracy when training passes 90 %, %", percent,
        of=_mean("test_accuracy_at_target")),
    "train_accuracy_max": Column("Training accuracy, maximum, %", percent,
        of=_mean("train_accuracy_max")),
    "train_accuracy_final": Column("Training accuracy, %", percent,
        of=_mean("train_accuracy_final")),
    "test_accuracy_max": Column("Test accuracy, maximum, %", percent,
        of=_mean("test_accuracy_max"), note="A maximum over a run has no interval."),
    "test_accuracy_final": Column("Test accuracy, % [95 %]", percent,
        of=lambda group, _: estimates.share(group),
        note="95 % intervals: Student over seeds, never narrower than the test set allows; Wilson "
        "for one seed or one recording."),
    "n_test": Column("Test samples", of=lambda group, _: len(group.right)),
    "over_hdc": Column("Difference from HDC, points [95 %]", points, of=_difference,
        note="Difference from HDC: paired by seed on the same test samples; above zero, the model "
        "is more accurate."),
    "model_bytes": Column("Size", size, of=_same(lambda record: record.model_bytes)),
    "predict_single_s": Column("Prediction, ms per frame", milliseconds,
        of=_median("predict_single_s")),
    "predict_batch_s_per_frame": Column("Prediction in a batch, ms per frame", milliseconds,
        of=_median("predict_batch_s_per_frame")),
    "origin": Column("Frames", of=_kind),
    "cpu": Column("Processor", of=_same(lambda record: record.environment.cpu)),
    "threads": Column("Threads", of=_same(lambda record: record.environment.threads)),
    "code": Column("Code", of=lambda group, _: group.runs[0].environment.short_commit),
    # Of measurements.
    "accuracy": Column("Accuracy, %", percent),
    "test_accuracy": Column("Test accuracy, %", percent),
    "train_accuracy": Column("Training accuracy, %", percent),
    "seconds": Column("Time, s"),
}
# fmt: on
