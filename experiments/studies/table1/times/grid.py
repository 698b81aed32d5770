"""Every training time relative to HDC in the same implementation: Table I's own from its runs, the
others from ``times_grid``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group, Groups
from experiments.records.results import RUNS, of_scenes
from experiments.reporting import estimates
from experiments.reporting.estimates import median_range
from experiments.reporting.table import frame
from experiments.studies.table1 import models
from experiments.studies.table1.rows import ratios_of_seeds

NAME = "times_grid"
OF = (RUNS, NAME)
DEFAULT = "default"  # of model=NAME: the runs of Table I
WAYS = {
    "libraries": "standard libraries",
    DEFAULT: "by default",
    "tuned": "tuned",
}
MODELS = ("hdc", "softmax", "softmax_dual", "ridge", "cnn1", "cnn3")
COLUMNS = (
    *("way", "model", "seconds", "ratio", "ratio_low", "ratio_high", "at_least"),
    *("runs", "coverage", "train_accuracy", "test_accuracy"),
)
Line = dict[str, Any]


def grid(lines: pd.DataFrame) -> pd.DataFrame:
    """One row per implementation and model, HDC first.

    ``seconds`` is the median over ``runs``, each of a seed of its own; ``ratio`` that of the ratios
    to HDC of the same seed, between order statistics ``ratio_low`` and ``ratio_high`` that hold it
    with probability ``coverage``. A training that never got there counts as infinitely long;
    ``at_least`` is then the ratio of the time that it was given.
    """
    return frame(every_line(lines), COLUMNS)


def every_line(lines: pd.DataFrame) -> list[Line]:
    """The rows of :func:`grid`, each with the ``command`` that made it and its ``record``."""
    found = [*_of_runs(Groups.of(lines)), *_measured(lines)]
    ways, names = list(WAYS), list(MODELS)
    found.sort(key=lambda line: (ways.index(line["way"]), names.index(line["model"])))
    return found


def _of_runs(runs: Groups) -> Iterator[Line]:
    """Rows of the runs of Table I."""
    hdc = runs.group(models.scene(), "hdc")
    for model in MODELS:
        group = runs.group(models.scene(), model)
        ratios = [1.0] if group == hdc else ratios_of_seeds(group, hdc)
        if group.runs and ratios:
            times = [estimates.training_time(run) for run in group.runs]
            line = _line(DEFAULT, model, times, ratios) | _accuracies(group)
            if group == hdc:
                line["runs"] = len(group.runs)
            command = group.runs[0].command
            yield line | {"command": command, "record": "records.jsonl"}


def _accuracies(group: Group) -> Line:
    """Mean accuracies where the training time ends."""
    found = {}
    for name in ("train_accuracy", "test_accuracy"):
        ends = "at_target" if group.runs[0].iterative else "final"
        values = [getattr(run, f"{name}_{ends}") for run in group.runs]
        known = [value for value in values if value is not None]
        found[name] = float(np.mean(known)) if known else math.nan
    return found


def _measured(lines: pd.DataFrame) -> Iterator[Line]:
    """Rows of the other implementations, on the experiment's own frames."""
    measured = of_scenes(lines, NAME).values()
    rows = next((rows for rows in measured if not rows.elsewhere.any()), None)
    if rows is None:
        return
    for (way, model), part in rows[rows.way != DEFAULT].groupby(["way", "model"]):
        seconds = part.seconds.astype(float).fillna(math.inf)
        line = _line(
            way, model, seconds.tolist(), (seconds / part.hdc_seconds).tolist()
        )
        if line["ratio"] == math.inf and "trained_s" in part:
            line["at_least"] = float(np.median(part.trained_s / part.hdc_seconds))
        for name in ("train_accuracy", "test_accuracy"):
            line[name] = float(part[name].mean())
        yield line | {"command": part.command.iloc[0], "record": part.record.iloc[0]}


def _line(
    way: str, model: str, seconds: Sequence[float], ratios: Sequence[float]
) -> Line:
    ratio, coverage = median_range(ratios)
    line: Line = {"way": way, "model": model, "seconds": float(np.median(seconds))}
    return line | ratio.columns("ratio") | {"runs": len(ratios), "coverage": coverage}
