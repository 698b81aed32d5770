"""Rows of Table I: each from its own trainings, one per seed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group, Groups
from experiments.records.run import Finished
from experiments.reporting import estimates
from experiments.reporting.estimates import median_range
from experiments.reporting.rows import row
from experiments.reporting.table import frame
from experiments.studies.table1 import models
from experiments.studies.table1.models import LINES

RATIO, AT_PAPERS = "training_time_over_hdc", "test_accuracy_at_papers"
OVER_NUMPY = "training_time_over_numpy_hdc"


def table1(lines: pd.DataFrame) -> pd.DataFrame | None:
    """Table I, and below it the same softmax regression solved directly and one's own models; None
    where none was run."""
    runs, place = Groups.of(lines), models.scene()
    groups = [runs.group(place, name) for name in (*LINES, *runs.extra_models(place))]
    if not any(group.runs for group in groups):
        return None
    rows = [_row(group, groups[0]) for group in groups]
    always = {*models.PAPER, models.DESCENT}
    return frame([line for line in rows if line["seeds"] or line["model"] in always])


def _row(group: Group, hdc: Group) -> dict[str, Any]:
    papers, relative = models.papers_numbers(group.model), relative_times(group, hdc)
    return row(group, hdc) | papers | relative | at_papers_accuracy(group)


def hdc_seconds(run: Finished, hdc: Group) -> float | None:
    """Training time of HDC that times of a run are relative to: of HDC that was trained just before
    and just after; where none was, of its run of the same seed on the same machine."""
    if "hdc" in run.beside_s:
        return run.beside_s["hdc"]
    for other in hdc.runs:
        if other.seeds == run.seeds and _machine(other) == _machine(run):
            return estimates.training_time(other)
    return None


def _machine(run: Finished) -> tuple[str, int]:
    return run.environment.cpu, run.environment.threads


def ratios_of_seeds(group: Group, hdc: Group) -> list[float]:
    """Training times relative to HDC, as :func:`hdc_seconds`: one per seed that has it."""
    pairs = [(run, hdc_seconds(run, hdc)) for run in group.runs]
    return [estimates.training_time(run) / s for run, s in pairs if s is not None]


def ratios_beside(group: Group, form: str) -> list[float]:
    """Training times relative to a form of HDC that was trained beside each."""
    return [
        estimates.training_time(run) / run.beside_s[form]
        for run in group.runs
        if form in run.beside_s
    ]


def relative_times(group: Group, hdc: Group) -> dict[str, float]:
    """Median over seeds of the training time relative to HDC, as claims judge it; and relative to
    HDC by NumPy's median. Nothing where a seed never reached 90 %."""
    if group.model == "hdc":
        return {}
    every = {
        RATIO: ratios_of_seeds(group, hdc),
        OVER_NUMPY: ratios_beside(group, "hdc_numpy"),
    }
    found: dict[str, float] = {}
    for name, ratios in every.items():
        if ratios and math.inf not in ratios:
            found |= median_range(ratios)[0].columns(name)
    return found


def at_papers_accuracy(group: Group) -> dict[str, Any]:
    """Test accuracy at the first checkpoint whose training accuracy is at or above the paper's, its
    interval over the seeds that get there, and their number; a model without a training accuracy
    in the paper has its test accuracy when it is fitted."""
    if not group.runs:
        return {}
    level = models.papers_training_accuracy(group.model)
    found = [test_accuracy_at(run, level) for run in group.runs]
    known = [value for value in found if value is not None]
    made: dict[str, Any] = {"published_training_accuracy": level}
    if known:
        n_test = float(np.mean([run.n_test for run in group.runs]))
        made |= estimates.mean_share(known, n_test).columns(AT_PAPERS)
    return made | {"seeds_at_papers": len(known)}


def test_accuracy_at(run: Finished, level: float | None) -> float | None:
    """Test accuracy at the first checkpoint of a curve with at least this training accuracy; None
    if there is none. A model that learns in one pass has one accuracy."""
    if not run.iterative:
        return run.test_accuracy_final
    if level is None:
        return None
    reached = (p for p in run.curve if p.get("train_accuracy", -1) >= level)
    return next((point["test_accuracy"] for point in reached), None)
