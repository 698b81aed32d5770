"""Table I, each row from its own trainings, one per seed."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from experiments.records import configs
from experiments.records.results import CHECKPOINTS, ROW, RUNS, of_experiment
from experiments.reporting import estimates, published
from experiments.reporting.estimates import median_range
from experiments.reporting.resamples import RIVAL
from experiments.reporting.trained import extra_models, of_runs, whole

OF = (RUNS, CHECKPOINTS)
RATIO, AT_PAPERS = "training_time_over_hdc", "test_accuracy_at_papers"
AT_LEAST = "at_least_over_hdc"
DISTURBED, _REASON = "disturbed", "load.disturbed"  # columns of a table, of runs
BESIDE_HDC = "beside.hdc_s"

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
    """Training time relative to HDC and test accuracy in the row of the paper's Table I; None where
    it has none."""
    row = papers_row(model)
    ratio = published.value(f"table1/{row}_time_over_hdc")
    return {
        "published_training_time_over_hdc": 1.0 if row == "hdc" else ratio,
        "published_test_accuracy": published.value(f"table1/{row}_test_accuracy"),
    }


def papers_training_accuracy(model: str) -> float | None:
    """The training accuracy that the paper gives for a model, a fraction; None without one."""
    return published.value(f"table1/{papers_row(model)}_training_accuracy")


def table1(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each model of Table I that was run, below it the same softmax regression solved
    directly and one's own models; None where none was run."""
    runs = on_scene(of_experiment(frame, RUNS))
    names = [*LINES, *extra_models(runs, scene())]
    runs = runs[runs.model.isin(names)]
    if not len(runs):
        return None
    table = of_runs(runs).drop(columns=ROW[2:]).set_index("model", drop=False)
    table = table.loc[[name for name in names if name in table.index]]
    reports = of_experiment(frame, CHECKPOINTS)
    rows = [
        papers_numbers(model) | _measured(runs[runs.model == model], reports)
        for model in table.model
    ]
    beside = pd.DataFrame(rows, index=table.index, dtype=object)
    return pd.concat([table, beside], axis="columns")


def on_scene(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs on all samples and all pixels of the scene of Table I."""
    return whole(runs[runs.scene == scene()])


def _measured(runs: pd.DataFrame, reports: pd.DataFrame) -> dict[str, Any]:
    """The columns that only Table I has: relative times, accuracies, and the disturbance."""
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
    """Median over seeds of the training time relative to HDC that was trained just before and just
    after; for a training that never reached 90 %, a lower bound."""
    if runs.model.iloc[0] == "hdc":
        return {RATIO: 1.0}
    if BESIDE_HDC not in runs or runs[BESIDE_HDC].isna().all():
        return {}
    timed = runs.dropna(subset=BESIDE_HDC)
    ratios = (timed.training_time_s / timed[BESIDE_HDC]).tolist()
    if math.inf not in ratios:
        return median_range(ratios).columns(RATIO)
    return {AT_LEAST: float((timed.total_time_s / timed[BESIDE_HDC]).median())}


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
        own = reports[reports.record.isin(runs.record)]
        known = own[own.train_accuracy >= level].drop_duplicates("record").test_accuracy
    made: dict[str, Any] = {"published_training_accuracy": level}
    if len(known):
        share = estimates.mean_share(known.tolist(), float(runs.n_test.mean()))
        made |= share.columns(AT_PAPERS)
    return made | {"seeds_at_papers": len(known)}
