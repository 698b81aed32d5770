"""Rows of Table I and of its sister of few samples: each from its own trainings, one per seed."""

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

# Training samples on a scene, five of each class: no model is near 100 %.
FEW = {"touch": 25, "finger": 35}
RATIO, AT_PAPERS = "training_time_over_hdc", "test_accuracy_at_papers"
OVER_NUMPY = "training_time_over_numpy_hdc"


def table1(lines: pd.DataFrame) -> pd.DataFrame | None:
    """Table I, and below it the same softmax regression solved directly and one's own models."""
    return rows_of_table(lines, models.scene())


def table1_few(lines: pd.DataFrame) -> pd.DataFrame | None:
    """The same rows from few samples, on two scenes; only models that were run, and only where the
    published rival was."""
    runs, parts = Groups.of(lines), []
    for place, n_train in FEW.items():
        data = rows_of_table(lines, place, n_train, paper=False)
        if data is not None and runs.group(place, "softmax", n_train).runs:
            parts.append(data[data.seeds > 0])
    return pd.concat(parts, ignore_index=True) if parts else None


def rows_of_table(
    of: pd.DataFrame,
    place: str,
    n_train: int | None = None,
    paper: bool = True,
) -> pd.DataFrame | None:
    """A row for each model of Table I on a scene; None where none was run."""
    runs = Groups.of(of)
    names = [*LINES]
    if n_train is None:
        names += runs.extra_models(place)
    groups = [runs.group(place, name, n_train) for name in names]
    if not any(group.runs for group in groups):
        return None
    lines = [_row(group, groups[0], paper) for group in groups]
    always = {*models.PAPER, models.DESCENT}
    return frame([line for line in lines if line["seeds"] or line["model"] in always])


def _row(group: Group, hdc: Group, paper: bool) -> dict[str, Any]:
    line, relative = row(group, hdc), relative_times(group, hdc)
    if not paper:
        return line | relative
    papers = models.papers_numbers(group.model)
    return line | papers | relative | at_papers_accuracy(group)


def ratios_of_seeds(group: Group, hdc: Group) -> list[float]:
    """Training times relative to HDC, a number a seed: to HDC that was trained just before and just
    after; where none was, to its run of the same seed on the same machine."""
    by_seed = {}
    if group.machines == hdc.machines and len(group.machines) == 1:
        by_seed = {run.seeds: estimates.training_time(run) for run in hdc.runs}
    ratios = []
    for run in group.runs:
        hdc_s = run.beside_s.get("hdc", by_seed.get(run.seeds))
        if hdc_s is not None:
            ratios.append(estimates.training_time(run) / hdc_s)
    return ratios


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
