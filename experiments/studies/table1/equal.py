"""How long a model takes to be as accurate as HDC."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.run import Finished
from experiments.reporting import estimates
from experiments.reporting.table import frame
from experiments.reporting.text import number
from experiments.studies.table1 import models
from experiments.studies.table1.rows import hdc_seconds


def seconds_to(run: Finished, accuracy: float) -> float:
    """Training time at the first report of at least this test accuracy; infinite without one.
    A one-pass model is asked once, when it is fitted."""
    if not run.iterative:
        if run.test_accuracy_final < accuracy:
            return math.inf
        return run.training_s
    for report in run.curve:
        if report.get("test_accuracy", -1) >= accuracy:
            return report["training_s"]
    return math.inf


def _over_seeds(name: str, values: Sequence[float]) -> dict[str, float]:
    """Median, and lowest to highest where they differ; nothing of no values."""
    if not values:
        return {}
    estimate = estimates.Estimate(float(np.median(values)))
    lowest, highest = min(values), max(values)
    if lowest < highest:
        estimate = estimate._replace(low=lowest, high=highest)
    return estimate.columns(name)


def or_never(value: float) -> str:
    """A time or a ratio; infinite where a model never got there."""
    return number(value) if math.isfinite(value) else "never"


def equal_accuracy(lines: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each model of Table I and its extension, and one for the fewest pixels it needs."""
    runs = Groups.of(lines)
    hdc = runs.group(models.scene(), "hdc")
    names = [
        *configs.sweep("table1")["model"],
        *configs.sweep("table1_descent")["model"],
        *configs.sweep("table1_extended")["model"],
        *runs.extra_models(models.scene()),
    ]
    rows = []
    for model in dict.fromkeys(names):
        for group in _by_pixels(runs, model):
            line = _as_accurate(group, hdc)
            if line is None:
                continue
            rows.append(line)
            if group.pixels:  # fewer than any that follow
                break
    return frame(rows)


def _by_pixels(runs: Groups, model: str) -> list[Group]:
    """Groups of a model on the scene of Table I: all pixels first, then from the fewest up."""
    place = (models.scene(), model)
    groups = [g for g in runs if (g.scene, g.model) == place]
    of_all_samples = [group for group in groups if group.n_train is None]
    return sorted(of_all_samples, key=lambda group: group.pixels or 0)


def _as_accurate(group: Group, hdc: Group) -> dict[str, Any] | None:
    """Times to the accuracy of HDC of the same seed; None without such seeds, or where one with
    fewer pixels never gets there. A training that its budget ended before says nothing."""
    ours = {run.seeds: run for run in hdc.runs}
    times, ratios = [], []
    for run in group.runs:
        if run.seeds in ours:
            record = ours[run.seeds]
            time = seconds_to(run, record.test_accuracy_final)
            if time == math.inf and run.stop == "budget":
                continue
            times.append(time)
            hdc_s = record.training_s if run is record else hdc_seconds(run, hdc)
            if hdc_s is not None:
                ratios.append(time / hdc_s)
    if not times or (group.pixels and max(times) == math.inf):
        return None
    return {
        "model": group.model,
        "pixels": group.pixels or "all",
        "seeds": len(times),
        **_over_seeds("time", times),
        **_over_seeds("ratio", ratios),
    }
