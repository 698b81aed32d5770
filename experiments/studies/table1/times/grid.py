"""The grid of times: each model relative to HDC in each implementation; from ``times_grid``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group
from experiments.reporting.estimates import median_range
from experiments.reporting.table import frame, records

NAME = "times_grid"
DEFAULT = "default"  # the way of model=NAME
WAYS = {
    "libraries": "standard libraries",
    DEFAULT: "by default",
    "tuned": "tuned",
}
COLUMNS = (
    *("way", "model", "seconds", "ratio", "ratio_low", "ratio_high", "turns"),
    *("coverage", "train_accuracy", "test_accuracy", "route"),
)


def grid(rows: pd.DataFrame) -> pd.DataFrame:
    """One row a way and model, from one row a training: HDC of a way first, others as measured.

    ``seconds`` is the median over ``turns``; ``ratio`` that of the ratios to HDC in the same turn,
    between order statistics ``ratio_low`` and ``ratio_high`` that hold it with probability
    ``coverage``. A training that never got there counts as infinitely long.
    """
    lines = []
    for (way, model), part in rows.groupby(["way", "model"], sort=False):
        seconds = part.seconds.astype(float).fillna(math.inf)
        ratios = seconds / part.hdc_seconds
        ratio, coverage = median_range(ratios.tolist())
        line: dict[str, Any] = {"way": way, "model": model}
        line["seconds"] = float(np.median(seconds))
        line |= {"ratio": ratio.value, "ratio_low": ratio.low, "ratio_high": ratio.high}
        line |= {"turns": len(part), "coverage": coverage}
        for name in ("train_accuracy", "test_accuracy"):
            line[name] = float(part[name].mean())
        line["route"] = part.route.iloc[0]
        lines.append(line)
    ways = list(dict.fromkeys(rows.way))
    lines.sort(key=lambda line: (ways.index(line["way"]), line["model"] != "hdc"))
    return frame(lines, COLUMNS)


def beside(lines: pd.DataFrame, group: Group) -> pd.DataFrame:
    """Rows of :func:`grid` on the scene of a group, its samples, processor and threads; none where
    it was not measured beside the group."""
    is_beside = (lines.experiment == NAME) & (lines.scene == group.scene)
    measured = lines[is_beside & ~lines.elsewhere.astype(bool)]
    if not len(measured) or group.n_train is not None or group.pixels is not None:
        return frame([], COLUMNS)
    machine = measured.iloc[0]
    if group.runs and group.machines != {(machine.cpu, machine.threads)}:
        return frame([], COLUMNS)
    return grid(measured)


def default_times(lines: pd.DataFrame, group: Group) -> dict[str, dict[str, Any]]:
    """Rows of the default way by model, of :func:`beside`."""
    rows = records(beside(lines, group))
    return {row["model"]: row for row in rows if row["way"] == DEFAULT}
