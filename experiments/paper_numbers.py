"""The paper's numbers as measured here: rows for the lines of results/published.csv.

Rows come from run records (Figs. 5 to 7 and 9) and from the measurements ``correlation`` (Fig. 4)
and ``drift`` (Fig. 8); Table I has its own (:mod:`experiments.tables`). What has no record has no
row. An accuracy pools the test samples of all seeds and has Wilson's interval; any other number is
the mean over the seeds, with Student's interval for what differs between them: sensor, samples and
split.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments import evaluate, sources
from experiments.measurement import Measured, read
from experiments.selection import Group, Records, numbers, sweep

Row = dict[str, Any]

WILSON = "Wilson, test samples of all seeds"
STUDENT = "Student t, over seeds"
BAND = "where the Wilson band crosses 90 %"


def summary_rows(results: Path) -> list[Row]:
    """One row for each published number that is measured, and for some that only we measure.

    Args:
        results: the folder that holds ``runs/`` and ``measured/``.

    Returns:
        list: rows with the keys

        - ``experiment``, ``quantity``: those of published.csv, or new ones;
        - ``condition``: tells rows of one quantity apart where the paper leaves it open;
        - ``measured``, ``low``, ``high``: in the unit of published.csv; bounds at 95 %, or None;
        - ``interval``: what the bounds are;
        - ``unit``, ``n`` (test samples, or frames), ``seeds``;
        - ``source``: records, as paths below ``results``; ``code``: ``current``, or the files of
          code that have changed since.
    """
    records = Records(results)
    rows: list[Row] = []
    for scene in ("finger", "spatial", "tactile"):
        rows += accuracy_rows(records.group(scene, "hdc"))
    rows += label_rows(records.group("touch", "hdc"))
    rows += crossing_rows(records)
    rows += position_rows(records.group("spatial", "hdc"))
    if (measured := finished(results, "correlation")) is not None:
        rows += correlation_rows(measured)
    if (measured := finished(results, "drift")) is not None:
        rows += drift_rows(measured)
    return rows


def finished(results: Path, name: str) -> Measured | None:
    """A measurement that came to its end, or None."""
    measured = read(results, name)
    return measured if measured and measured.record["status"] == "finished" else None


# Intervals ----------------------------------------------------------------------------------------


def mean_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and 95 % Student interval of independent values; NaN bounds for a single one."""
    from scipy.stats import t

    mean, n = float(np.mean(values)), len(values)
    if n < 2:
        return mean, math.nan, math.nan
    half = float(t.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    return mean, mean - half, mean + half


def crossing(n: Sequence[float], accuracy: Sequence[float], level: float = 0.9) -> float | None:
    """N at which a curve first rises above the level, between two N by straight lines."""
    order = np.argsort(n)
    x, y = np.asarray(n, float)[order], np.asarray(accuracy, float)[order]
    above = np.flatnonzero(y > level)
    if not len(above):
        return None
    k = int(above[0])
    return float(x[0] if k == 0 else np.interp(level, y[k - 1 : k + 1], x[k - 1 : k + 1]))


# From run records ---------------------------------------------------------------------------------


def accuracy_rows(group: Group) -> list[Row]:
    """Test accuracy in percent, of the samples of all seeds together."""
    if not group.runs:
        return []
    right, n_test = right_of(group)
    low, high = evaluate.wilson(right, n_test)
    value = [100 * x for x in (right / n_test, low, high)]
    return [_row(group.scene, "test_accuracy", value, WILSON, "%", n_test, _of_runs(group))]


def label_rows(group: Group) -> list[Row]:
    """How many labels the scene has."""
    if not group.runs:
        return []
    n = len(group.runs[0].record["scene"]["classes"])
    samples = group.runs[0].record["scene"]["n"]
    value = (n, None, None)
    return [_row(group.scene, "labels", value, "", "classes", samples, _of_runs(group))]


def crossing_rows(records: Records) -> list[Row]:
    """Fig. 5(b): the number of training samples at which HDC exceeds 90 %."""
    params = sweep("accuracy_vs_n")
    groups = [records.group(params["scene"][0], "hdc", n) for n in numbers(params["split.n_train"])]
    groups = [group for group in groups if group.runs]
    if len(groups) < 2:
        return []
    sizes = [group.runs[0].record["n_train"] for group in groups]
    pooled = [right_of(group) for group in groups]
    bounds = [evaluate.wilson(*pair) for pair in pooled]
    value = crossing(sizes, [right / n_test for right, n_test in pooled])
    if value is None:
        return []
    low, high = (crossing(sizes, [pair[side] for pair in bounds]) for side in (1, 0))
    # The group with the fewest seeds says how many stand behind every point.
    least = min(groups, key=lambda group: len(group.runs))
    made = {**_of_runs(least), "source": _paths(run for group in groups for run in group.runs)}
    found = (value, low, high)
    return [_row("accuracy_vs_n", "n_for_90_percent", found, BAND, "samples", min(sizes), made)]


def position_rows(group: Group) -> list[Row]:
    """Fig. 7: the error of the position in millimetres; the paper gives none."""
    if not group.runs:
        return []
    errors = [1e3 * np.abs(position_errors(run.record)) for run in group.runs]
    n = sum(map(len, errors))
    return [
        _row("spatial", f"{name}_position_error",
             mean_interval([float(of(error)) for error in errors]), STUDENT, "mm", n,
             _of_runs(group))
        for name, of in (
            ("mean", np.mean), ("median", np.median), ("p95", lambda e: np.percentile(e, 95))
        )
    ]  # fmt: skip


def right_of(group: Group) -> tuple[int, int]:
    """Right predictions and test samples of all seeds."""
    records = [run.record for run in group.runs]
    right = sum(int(np.equal(r["predicted"], r["test_labels"]).sum()) for r in records)
    return right, sum(r["n_test"] for r in records)


def positions(record: Mapping[str, Any]) -> np.ndarray:
    """Places along the line of contacts of a record of the scene ``spatial``: m [L]."""
    line = record["config"]["scene"]["classes"]
    length = math.dist(line["start"], line["stop"])
    return np.linspace(0.0, length, line["number"])


def position_errors(record: Mapping[str, Any]) -> np.ndarray:
    """Predicted minus true position of each test sample: m [Q]."""
    at = positions(record)
    return at[np.asarray(record["predicted"])] - at[np.asarray(record["test_labels"])]


# From measurements --------------------------------------------------------------------------------


def correlation_rows(measured: Measured) -> list[Row]:
    """Fig. 4: the largest C^s_ll and the contrasts ΔC."""
    return []


def drift_rows(measured: Measured) -> list[Row]:
    """Fig. 8(b): accuracy before and after recalibration with N_new = 50."""
    return []


# Parts --------------------------------------------------------------------------------------------


def _row(
    experiment: str,
    quantity: str,
    value: Sequence[float | None],
    interval: str,
    unit: str,
    n: int,
    made: Row,
    condition: str = "",
) -> Row:
    measured, low, high = (None if x is None or math.isnan(x) else x for x in value)
    return {
        "experiment": experiment,
        "quantity": quantity,
        "condition": condition,
        "measured": measured,
        "low": low,
        "high": high,
        "interval": interval if low is not None or high is not None else "",
        "unit": unit,
        "n": n,
        **made,
    }


def _of_runs(group: Group) -> Row:
    """What a row says of the runs it is from."""
    files = {k: v for run in group.runs for k, v in run.record["environment"]["sources"].items()}
    return {
        "seeds": len(group.runs),
        "source": _paths(group.runs),
        "code": ", ".join(sources.outdated(files)) or "current",
    }


def _paths(runs: Iterable[Any]) -> str:
    return " ".join(f"runs/{run.record['id']}" for run in runs)
