"""Rows of Table I and of its sister of few samples: each from its own trainings, one per seed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group, Groups
from experiments.records.run import Finished
from experiments.reporting import estimates
from experiments.reporting.estimates import Estimate
from experiments.reporting.rows import row
from experiments.reporting.table import frame
from experiments.studies.table1 import models
from experiments.studies.table1.models import LINES

# Training samples on a scene, five of each class: no model is near 100 %.
FEW = {"touch": 25, "finger": 35}
RATIO, AT_PAPERS = "training_time_over_hdc", "test_accuracy_at_papers"


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
    line, relative = row(group, hdc), relative_time(group, hdc)
    if not paper:
        return line | relative
    papers = models.papers_numbers(group.model)
    return line | papers | relative | at_papers_accuracy(group)


def ratios_of_seeds(group: Group, hdc: Group) -> list[float]:
    """Training times over HDC's of the same seed; none where they are of several machines."""
    if group.machines != hdc.machines or len(group.machines) != 1:
        return []
    beside = {run.seeds: estimates.training_time(run) for run in hdc.runs}
    return [
        estimates.training_time(run) / beside[run.seeds]
        for run in group.runs
        if run.seeds in beside
    ]


def relative_time(group: Group, hdc: Group) -> dict[str, float]:
    """Geometric mean over seeds of the training time relative to HDC, with Student's interval of
    the logarithms; nothing where a seed never reached 90 %."""
    ratios = ratios_of_seeds(group, hdc)
    if group.model == "hdc" or not ratios or math.inf in ratios:
        return {}
    logarithms = estimates.mean_interval(np.log(ratios).tolist())
    return Estimate(*np.exp(logarithms).tolist()).columns(RATIO)


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
