"""What records and measurements say, as arrays: for the paper's numbers and figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.measurement import Measured, read
from experiments.selection import Group

Floats = NDArray[np.float64]


class Estimate(NamedTuple):
    """A mean and its 95 % interval; bounds are NaN where they are not known."""

    value: float
    low: float = math.nan
    high: float = math.nan


class Update(NamedTuple):
    """Accuracies after an update: in the new environment, in the old one, and their mean."""

    new: Estimate
    old: Estimate
    both: Estimate


def mean_interval(values: Sequence[float]) -> Estimate:
    """Mean and Student's interval of independent values."""
    from scipy.stats import t

    mean, n = float(np.mean(values)), len(values)
    if n < 2:
        return Estimate(mean)
    half = float(t.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    return Estimate(mean, mean - half, mean + half)


def crossing(n: Sequence[float], accuracy: Sequence[float], level: float = 0.9) -> float:
    """N at which a curve first rises above the level, between two N on a line; NaN if it never
    does."""
    order = np.argsort(n)
    x, y = np.asarray(n, float)[order], np.asarray(accuracy, float)[order]
    above = np.flatnonzero(y > level)
    if not len(above):
        return math.nan
    k = int(above[0])
    return float(x[0] if k == 0 else np.interp(level, y[k - 1 : k + 1], x[k - 1 : k + 1]))


# Run records --------------------------------------------------------------------------------------


def right_of(group: Group) -> tuple[int, int]:
    """Right predictions and test samples of all seeds."""
    records = [run.record for run in group.runs]
    right = sum(int(np.equal(r["predicted"], r["test_labels"]).sum()) for r in records)
    return right, sum(r["n_test"] for r in records)


def confusion_of(group: Group) -> tuple[list[str], NDArray[np.int64]]:
    """Classes, and test samples of all seeds by true (row) and predicted class."""
    total = np.sum([run.record["confusion"] for run in group.runs], axis=0)
    return group.runs[0].record["scene"]["classes"], total.astype(np.int64)


def positions(record: Mapping[str, Any]) -> Floats:
    """Places along the line of contacts of a record of the scene ``spatial``: m [L]."""
    line = record["config"]["scene"]["classes"]
    return np.linspace(0.0, math.dist(line["start"], line["stop"]), line["number"])


def position_errors(record: Mapping[str, Any]) -> Floats:
    """Predicted minus true position of each test sample: m [Q]."""
    at = positions(record)
    return at[np.asarray(record["predicted"])] - at[np.asarray(record["test_labels"])]


# Measurements -------------------------------------------------------------------------------------


def finished(results: Path, name: str) -> Measured | None:
    """A measurement that came to its end, or None."""
    measured = read(results, name)
    return measured if measured and measured.record["status"] == "finished" else None


def origin_of(measured: Measured) -> str:
    """Where its frames come from: ``simulated``, ``recorded`` …"""
    return " and ".join(sorted({row["origin"] for row in measured.rows}))


def matrices(measured: Measured, kind: str, samples: str) -> tuple[list[str], Floats, int]:
    """Correlation matrices of ``class_correlations``: classes, C [seeds, L, L], samples a class.

    Raises:
        ValueError: if the measurement has none of this kind and these samples.
    """
    rows = [r for r in measured.rows if (r["kind"], r["samples"]) == (kind, samples)]
    if not rows:
        name = measured.record["name"]
        raise ValueError(f"measured/{name}/rows.csv: expected rows {kind}, {samples}, found none")
    classes = list(dict.fromkeys(row["class_i"] for row in rows))
    seeds = list(dict.fromkeys(row["seed"] for row in rows))
    values = np.full((len(seeds), len(classes), len(classes)), np.nan)
    for row in rows:
        place = seeds.index(row["seed"]), *(classes.index(row[k]) for k in ("class_i", "class_j"))
        values[place] = float(row["value"])
    return classes, values, int(rows[0]["n"])


def updates(measured: Measured) -> dict[tuple[str, float | None], dict[int, Update]]:
    """Accuracies of ``drift`` by (method, parameter or None) and N_new.

    Each estimate is over seeds, of the means over their draws: the samples of a seed share sensor
    and prototypes.
    """
    found: dict[tuple[str, float | None], dict[int, dict[str, list[tuple[float, float]]]]] = {}
    for row in measured.rows:
        parameter = row.get("parameter")
        key = row["method"], None if parameter is None else float(parameter)
        by_seed = found.setdefault(key, {}).setdefault(int(row["n_new"]), {})
        pair = tuple(int(row[f"right_{s}"]) / int(row[f"n_test_{s}"]) for s in ("new", "old"))
        by_seed.setdefault(row["seed"], []).append(pair)  # type: ignore[arg-type]
    return {
        key: {n: _estimate(by_seed) for n, by_seed in sorted(by_n.items())}
        for key, by_n in found.items()
    }


def _estimate(by_seed: Mapping[str, Sequence[tuple[float, float]]]) -> Update:
    means = np.array([np.mean(draws, axis=0) for draws in by_seed.values()])
    return Update(*(mean_interval(column) for column in (*means.T, means.mean(1))))
