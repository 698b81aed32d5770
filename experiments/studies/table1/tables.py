"""Table I, each row from its own trainings, one per seed; and the time to the accuracy of HDC."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import CHECKPOINTS, ROW, RUNS, of_experiment
from experiments.reporting import estimates, published
from experiments.reporting.estimates import Estimate, median_range
from experiments.reporting.resamples import RIVAL
from experiments.reporting.table import frame as table_of
from experiments.reporting.trained import (
    MACHINE,
    asked_for,
    extra_models,
    of_runs,
    whole,
)

OF = (RUNS, CHECKPOINTS)
RATIO, AT_PAPERS = "training_time_over_hdc", "test_accuracy_at_papers"
OVER_NUMPY = "training_time_over_numpy_hdc"
AT_LEAST = "at_least_over_hdc"
DISTURBED, _REASON = "disturbed", "load.disturbed"  # columns of a table, of runs
_BESIDE = {RATIO: "beside.hdc_s", OVER_NUMPY: "beside.hdc_numpy_s"}

PAPER = published.models_of_table1()
DESCENT = "softmax_descent"  # another recipe for the paper's softmax row
_PAPERS_ROW = {DESCENT: "softmax"}
_AT = PAPER.index("softmax") + 1
LINES = (*PAPER[:_AT], DESCENT, *PAPER[_AT:], RIVAL)


def scene() -> str:
    """Name of the scene of Table I."""
    return configs.sweep("table1")["scene"][0]


def papers_row(model: str) -> str:
    """The row of the paper's Table I that a model repeats: its own, or that of its recipe."""
    return _PAPERS_ROW.get(model, model)


def papers_numbers(model: str) -> dict[str, Any]:
    """Training time, absolute and relative to HDC, and test accuracy in the row of the paper's
    Table I; None where it has none."""
    row = f"table1/{papers_row(model)}"
    time = published.value(f"{row}_training_time")
    hdc = published.value("table1/hdc_training_time")
    return {
        "published_training_time_s": time,
        "published_training_time_over_hdc": time / hdc if time and hdc else None,
        "published_test_accuracy": published.value(f"{row}_test_accuracy"),
    }


def papers_training_accuracy(model: str) -> float | None:
    """The training accuracy that the paper gives for a model, a fraction; None without one."""
    return published.value(f"table1/{papers_row(model)}_training_accuracy")


def table1(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Table I, and below it the same softmax regression solved directly and one's own models; None
    where none was run."""
    runs = on_scene(of_experiment(frame, RUNS))
    names = [*LINES, *extra_models(runs, scene())]
    if not runs.model.isin(names).any():
        return None
    asked = [(scene(), model, 0, 0) for model in names]
    table = asked_for(of_runs(runs), asked).set_index("model", drop=False)
    always = {*PAPER, DESCENT}
    table = table[table.seeds.astype(bool) | table.model.isin(always)]
    reports = of_experiment(frame, CHECKPOINTS)
    rows = [
        papers_numbers(model) | _measured(runs[runs.model == model], reports)
        for model in table.model
    ]
    beside = pd.DataFrame(rows, index=table.index, dtype=object)
    return pd.concat([table, beside], axis="columns").drop(columns=ROW[2:])


def on_scene(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs on all samples and all pixels of the scene of Table I."""
    return whole(runs[runs.scene == scene()])


def _measured(runs: pd.DataFrame, reports: pd.DataFrame) -> dict[str, Any]:
    """The columns that only Table I has: relative times, accuracies, and the disturbance."""
    if not len(runs):
        return {}
    made = {**_relative_times(runs), **_at_papers(runs, reports)}
    return made | ({DISTURBED: why} if (why := disturbed(runs)) else {})


def disturbed(runs: pd.DataFrame) -> str:
    """Why the times of some of these runs do not count; empty where all times count."""
    if _REASON not in runs:
        return ""
    reasons = runs[_REASON].fillna("")
    found = list(filter(None, reasons))
    if not found or len(runs) == 1:
        return "".join(found)
    return f"{len(found)} of {len(runs)} seeds: {'; '.join(dict.fromkeys(found))}"


def _relative_times(runs: pd.DataFrame) -> dict[str, float]:
    """Medians over seeds of the training time relative to HDC that was trained just before and just
    after, and to HDC by NumPy's median; for a training that never reached 90 %, a lower bound."""
    if runs.model.iloc[0] == "hdc":
        return {RATIO: 1.0}
    found: dict[str, float] = {}
    for name, beside in _BESIDE.items():
        if beside not in runs or runs[beside].isna().all():
            continue
        timed = runs.dropna(subset=beside)
        ratios = (timed.training_time_s / timed[beside]).tolist()
        if math.inf not in ratios:
            found |= median_range(ratios).columns(name)
        elif name == RATIO:
            found[AT_LEAST] = float((timed.total_time_s / timed[beside]).median())
    return found


def _at_papers(runs: pd.DataFrame, reports: pd.DataFrame) -> dict[str, Any]:
    """Test accuracy at the first checkpoint whose training accuracy is at least the paper's, its
    interval over the seeds that get there, and their number; for a model that learns in one pass,
    its test accuracy."""
    level = papers_training_accuracy(str(runs.model.iloc[0]))
    if not runs.iterative.iloc[0]:
        known = runs.test_accuracy_final
    elif level is None:
        known = runs.test_accuracy_final[:0]
    else:
        levels = pd.Series(level, runs.record)
        known = first_reports(reports, "train_accuracy", levels).test_accuracy
    made: dict[str, Any] = {"published_training_accuracy": level}
    if len(known):
        share = estimates.mean_share(known.tolist(), float(runs.n_test.mean()))
        made |= share.columns(AT_PAPERS)
    return made | {"seeds_at_papers": len(known)}


def first_reports(reports: pd.DataFrame, name: str, levels: pd.Series) -> pd.DataFrame:
    """The first report of each run in which a quantity has at least a level, by record.

    Args:
        reports: lines of checkpoints.
        name: the quantity.
        levels: by record.
    """
    known = reports[reports.record.isin(levels.index)]
    reached = known[known[name] >= known.record.map(levels).astype(float)]
    return reached.drop_duplicates("record").set_index("record")


# The time to the accuracy of HDC ------------------------------------------------------------------


def with_hdc_seconds(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs with ``hdc_s``, the training time of HDC that theirs is relative to: of HDC that was
    trained just before and just after; where none was, of its run of the same seed on the same
    machine; NaN where there is none either."""
    of_hdc = runs[(runs.model == "hdc") & (runs.asked_d == 0)]
    times = of_hdc[["seeds", *MACHINE, "total_time_s"]]
    times = times.rename(columns={"total_time_s": "hdc_s"})
    joined = runs.merge(times, "left", ["seeds", *MACHINE])
    beside = _BESIDE[RATIO]
    if beside in joined:
        joined["hdc_s"] = joined[beside].fillna(joined.hdc_s)
    return joined


def equal_accuracy(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each model of Table I and its extension, and one for the fewest pixels it needs.

    ``time`` is in seconds, ``ratio`` relative to HDC; infinite where a model never gets there.
    """
    runs = of_experiment(frame, RUNS)
    of_scene = runs[(runs.scene == scene()) & (runs.asked_n == 0)]
    timed = _timed(of_scene, of_experiment(frame, CHECKPOINTS))
    experiments = ("table1", "table1_descent", "table1_extended")
    names = [name for each in experiments for name in configs.sweep(each)["model"]]
    rows = []
    for model in dict.fromkeys([*names, *extra_models(runs, scene())]):
        of_model = timed[timed.model == model]
        for pixels, same in of_model.groupby("asked_d"):
            fewer = pixels > 0
            if fewer and math.isinf(same.time.max()):
                continue
            rows.append(_as_accurate(model, pixels, same))
            if fewer:  # than any that follow
                break
    return table_of(rows)


def _timed(runs: pd.DataFrame, reports: pd.DataFrame) -> pd.DataFrame:
    """The runs that have a run of HDC of the same seed, with the ``time`` at which they first
    report its test accuracy; infinite without such a report. A training that its budget ended
    before says nothing, and is left out."""
    of_hdc = runs[(runs.model == "hdc") & (runs.asked_d == 0)]
    goals = of_hdc[["seeds", "test_accuracy_final"]]
    goals = goals.rename(columns={"test_accuracy_final": "goal"})
    every = with_hdc_seconds(runs).merge(goals, on="seeds")
    levels = every.set_index("record").goal
    reported = first_reports(reports, "test_accuracy", levels).training_s
    at_end = every.total_time_s.where(every.test_accuracy_final >= every.goal)
    time = every.record.map(reported).astype(float).where(every.iterative, at_end)
    is_goal = every.record.isin(
        of_hdc.record
    )  # its own time, not that of another beside it
    hdc_s = every.hdc_s.mask(is_goal, every.total_time_s)
    every = every.assign(time=time.fillna(math.inf), hdc_s=hdc_s)
    return every[np.isfinite(every.time) | (every.stop != "budget")]


def _as_accurate(model: str, pixels: int, runs: pd.DataFrame) -> dict[str, Any]:
    ratios = (runs.time / runs.hdc_s)[runs.hdc_s.notna()]
    return {
        "model": model,
        "pixels": pixels or "all",
        "seeds": len(runs),
        **_over_seeds("time", runs.time.tolist()),
        **_over_seeds("ratio", ratios.tolist()),
        **({DISTURBED: why} if (why := disturbed(runs)) else {}),
    }


def _over_seeds(name: str, values: Sequence[float]) -> dict[str, float]:
    """Median, and lowest to highest where they differ; nothing of no values."""
    if not values:
        return {}
    ends = sorted({min(values), max(values)})
    bounds = ends if len(ends) > 1 else ()
    return Estimate(float(np.median(values)), *bounds).columns(name)
