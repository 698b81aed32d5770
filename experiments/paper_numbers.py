"""The paper's numbers as measured here: rows for the lines of results/published.csv.

Rows come from run records (Figs. 5 to 7 and 9) and from the measurements ``correlation`` (Fig. 4)
and ``drift`` (Fig. 8); Table I has its own (:mod:`experiments.tables`). What has no record has no
row. An accuracy of run records pools the test samples of all seeds and has Wilson's interval; any
other number is the mean over the seeds, with Student's interval for what differs between them:
sensor, samples and split.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from experiments import evaluate, sources
from experiments.measurement import Measured
from experiments.paper_data import (
    Estimate,
    crossing,
    finished,
    matrices,
    mean_interval,
    position_errors,
    right_of,
    updates,
)
from experiments.selection import Group, Records, Run, numbers, sweep
from scenes.sensor.statistics import contrast

Row = dict[str, Any]

WILSON = "Wilson, test samples of all seeds"
STUDENT = "Student, over seeds"
BAND = "where the Wilson band crosses 90 %"
N_NEW = 50  # at which the paper reports the recovered accuracy


def summary_rows(results: Path, device: str = "cpu") -> list[Row]:
    """One row for each published number that is measured, and for some that only we measure.

    Args:
        results: the folder that holds ``runs/`` and ``measured/``.
        device: of the run records.

    Returns:
        list: rows with the keys

        - ``experiment``, ``quantity``: those of published.csv, or new ones;
        - ``condition``: tells rows of one quantity apart where the paper leaves it open, else "";
        - ``measured``, ``low``, ``high``: in ``unit``; bounds at 95 %, None where unknown;
        - ``interval``: what the bounds are; ``unit``: as in published.csv;
        - ``n``: test samples, or frames, of all seeds; ``seeds``: how many;
        - ``source``: folders below ``results``, separated by spaces; ``code``: ``current``, or the
          files of code that have changed since.
    """
    records = Records(results, device)
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


# From run records ---------------------------------------------------------------------------------


def accuracy_rows(group: Group) -> list[Row]:
    """Test accuracy of the samples of all seeds together."""
    if not group.runs:
        return []
    right, n_test = right_of(group)
    found = Estimate(right / n_test, *evaluate.wilson(right, n_test))
    return [_row(group.scene, "test_accuracy", _percent(found), WILSON, "%", n_test,
                 _of_runs(group.runs))]  # fmt: skip


def label_rows(group: Group) -> list[Row]:
    """How many labels the scene has."""
    if not group.runs:
        return []
    scene = group.runs[0].record["scene"]
    found = Estimate(len(scene["classes"]))
    made = _of_runs(group.runs)
    return [_row(group.scene, "labels", found, "", "classes", scene["n"] * made["seeds"], made)]


def crossing_rows(records: Records) -> list[Row]:
    """Fig. 5(b): the number of training samples at which HDC exceeds 90 %."""
    params = sweep("accuracy_vs_n")
    sizes = numbers(params["split.n_train"])
    groups = [records.group(params["scene"][0], "hdc", n) for n in sizes]
    groups = [group for group in groups if group.runs]
    if len(groups) < 2:
        return []
    n_train = [group.runs[0].record["n_train"] for group in groups]
    pooled = [right_of(group) for group in groups]
    bounds = [evaluate.wilson(*pair) for pair in pooled]
    value = crossing(n_train, [right / n_test for right, n_test in pooled])
    if math.isnan(value):
        return []
    # Where the upper end of the band is above 90 % the accuracy may be: the lower bound of N.
    low, high = (crossing(n_train, [pair[side] for pair in bounds]) for side in (1, 0))
    n_test = min(n for _, n in pooled)
    made = _of_runs([run for group in groups for run in group.runs])
    made["seeds"] = min(len(group.runs) for group in groups)
    return [_row("accuracy_vs_n", "n_for_90_percent", Estimate(value, low, high), BAND, "samples",
                 n_test, made)]  # fmt: skip


def position_rows(group: Group) -> list[Row]:
    """Fig. 7: the error of the position, of which the paper gives none."""
    if not group.runs:
        return []
    errors = [1e3 * np.abs(position_errors(run.record)) for run in group.runs]
    n, made = sum(map(len, errors)), _of_runs(group.runs)
    return [
        _row("spatial", f"{name}_position_error", mean_interval([float(of(e)) for e in errors]),
             STUDENT, "mm", n, made)
        for name, of in (
            ("mean", np.mean), ("median", np.median), ("p95", lambda e: np.percentile(e, 95))
        )
    ]  # fmt: skip


# From measurements --------------------------------------------------------------------------------


def correlation_rows(measured: Measured) -> list[Row]:
    """Fig. 4: the largest C^s_ll and the contrasts ΔC."""
    rows = []
    for quantity, kind, of in (
        ("max_same_class_speckle", "speckle", lambda c: float(np.diag(c).max())),
        ("contrast_speckle", "speckle", contrast),
        ("contrast_hypervector", "hypervector", contrast),
        ("contrast_prototype", "prototype", contrast),
    ):
        # The paper does not say whether Eq. 6 is about samples that made the prototypes.
        for samples in ("training", "held-out", "all") if kind == "prototype" else ("all",):
            classes, values, n = matrices(measured, kind, samples)
            rows.append(_row(
                "correlation", quantity, mean_interval([of(c) for c in values]), STUDENT, "1",
                len(values) * len(classes) * n, _of_measured(measured, len(values)),
                f"{samples} samples",
            ))  # fmt: skip
    return rows


def drift_rows(measured: Measured) -> list[Row]:
    """Fig. 8(b): accuracy before and after an update with N_new = 50, and what was forgotten."""
    found = updates(measured)
    stored = [row for row in measured.rows if row["method"] == "stored"]  # one of each seed
    made = _of_measured(measured, len(stored))
    rows = []
    for key, names, condition, n in (
        (("stored", None), ("stored_accuracy", "stored_accuracy_old"), "", 0),
        (("replace", 0.5), ("recovered_accuracy", "remembered_accuracy"), "p = 0.5", N_NEW),
        (("replace", 0.75), ("recovered_accuracy", "remembered_accuracy"), "p = 0.75", N_NEW),
        (("balance", 1.0), ("recovered_accuracy_balanced", "remembered_accuracy_balanced"),
         "counters of both, equal votes", N_NEW),
    ):  # fmt: skip
        update = found.get(key, {}).get(n)
        for session, quantity in zip(("new", "old"), names, strict=True) if update else ():
            n_test = sum(int(row[f"n_test_{session}"]) for row in stored)
            estimate = _percent(getattr(update, session))
            rows.append(_row("drift", quantity, estimate, STUDENT, "%", n_test, made, condition))
    return rows


# Parts --------------------------------------------------------------------------------------------


def _row(
    experiment: str,
    quantity: str,
    found: Estimate,
    interval: str,
    unit: str,
    n: int,
    made: Row,
    condition: str = "",
) -> Row:
    measured, low, high = (None if math.isnan(x) else x for x in found)
    return {
        "experiment": experiment,
        "quantity": quantity,
        "condition": condition,
        "measured": measured,
        "low": low,
        "high": high,
        "interval": "" if low is None and high is None else interval,
        "unit": unit,
        "n": n,
        **made,
    }


def _percent(found: Estimate) -> Estimate:
    """A fraction in percent; an interval of Student's ends where fractions do."""
    return Estimate(*(100 * x if math.isnan(x) else 100 * min(1.0, max(0.0, x)) for x in found))


def _of_runs(runs: Iterable[Run]) -> Row:
    """What a row says of the runs it is from, one for each seed."""
    runs = list(runs)
    files = {k: v for run in runs for k, v in run.record["environment"]["sources"].items()}
    return {
        "seeds": len(runs),
        "source": " ".join(f"runs/{run.record['id']}" for run in runs),
        "code": ", ".join(sources.outdated(files)) or "current",
    }


def _of_measured(measured: Measured, seeds: int) -> Row:
    return {
        "seeds": seeds,
        "source": f"measured/{measured.record['name']}",
        "code": ", ".join(measured.outdated) or "current",
    }
