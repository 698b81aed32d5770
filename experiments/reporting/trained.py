"""Trainings as rows: a row for each scene, model, number of samples and of pixels.

Times are medians over seeds, accuracies means. A mean of a quantity that some runs lack has the
number of those that have it beside it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import CHECKPOINTS, ROW, RUNS, of_experiment
from experiments.reporting import estimates
from experiments.reporting.columns import scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import counted, frames_of, kind_of, split_name

MACHINE = ["cpu", "threads"]
_MEDIANS = [
    *("training_time_s", "total_time_s"),
    *("predict_single_s", "predict_batch_s_per_frame"),
]
_MEANS = [
    *("train_accuracy_at_target", "test_accuracy_at_target"),
    *("train_accuracy_max", "train_accuracy_final", "test_accuracy_max"),
]
_FIRST = ["n_train", "stop_rule", "n_classes", "code", "others"]
_SAME = ["model_bytes", *MACHINE]
# Seconds: of a row whose runs were not alone on the machine they are left out.
_SECONDS = ["at_least_s", *_MEDIANS]
COLUMNS = [
    *("scene", "model", "n_train", "pixels", "seeds", "stop", "stop_rule", "status"),
    *("training_time_s", "at_least_s", "total_time_s"),
    *("train_accuracy_at_target", "test_accuracy_at_target", "seeds_at_target"),
    *("train_accuracy_max", "train_accuracy_final", "test_accuracy_max"),
    *("test_accuracy_final", "test_accuracy_final_low", "test_accuracy_final_high"),
    *("n_test", "over_hdc", "over_hdc_low", "over_hdc_high", "model_bytes"),
    *("predict_single_s", "predict_batch_s_per_frame", "origin", "split"),
    *("n_classes", "cpu", "threads", "code"),
]


def of_runs(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each of :data:`ROW` that was run, with :data:`COLUMNS`.

    Args:
        runs: lines of single trainings.
    """
    if not len(runs):
        return pd.DataFrame(columns=[*COLUMNS, *ROW[2:]])
    by_row = runs.groupby(ROW, sort=False)
    groups: dict[Any, pd.DataFrame] = dict(iter(by_row))
    each: dict[str, Any] = dict.fromkeys(_FIRST, "first")
    each |= dict.fromkeys(_MEDIANS, "median") | dict.fromkeys(_MEANS, "mean")
    each |= dict.fromkeys(_SAME, same)
    parts = [
        by_row.agg(each),
        by_row.agg(
            seeds=("record", "size"),
            alone=("exclusive", "sum"),
            stop=("stop", _listed),
            longest_s=("total_time_s", "max"),
            seeds_at_target=("test_accuracy_at_target", "count"),
            n_test=("n_test", "sum"),
        ),
        _of_each(groups),
    ]
    table = pd.concat(parts, axis="columns").astype(object).reset_index()
    table["status"] = [_status(row) for row in table.itertuples()]
    # A training that never passed 90 % has no time but that which it was given.
    never = np.isinf(table.training_time_s.astype(float))
    table["at_least_s"] = table.longest_s.where(never, None)
    table.loc[never, "training_time_s"] = None
    table.loc[table.alone < table.seeds, _SECONDS] = None
    return table[[*COLUMNS, *ROW[2:]]]


def same(values: Iterable[Any]) -> Any:
    """The value that all have, or ``mixed``."""
    distinct = set(values)
    return distinct.pop() if len(distinct) == 1 else "mixed"


def _listed(values: Iterable[str]) -> str:
    return "; ".join(sorted(set(values)))


def _of_each(groups: dict[Any, pd.DataFrame]) -> pd.DataFrame:
    """Test accuracy of each row, its difference from HDC on the same frames, and what these are."""
    rows = []
    for (scene, model, *sizes), lines in groups.items():
        first = lines.iloc[0]
        line: dict[str, Any] = {
            "pixels": first.asked_d or first.n_pixels,
            "origin": _kind(scene, first.origin),
            "split": split_of(lines),
        }
        line |= estimates.share(lines).columns("test_accuracy_final")
        hdc = groups.get((scene, "hdc", *sizes))
        found = None
        if model != "hdc" and hdc is not None:
            found = estimates.difference(lines, hdc)
        rows.append(line | (found or Estimate(np.nan)).columns("over_hdc"))
    names = pd.MultiIndex.from_tuples(groups, names=ROW)
    return pd.DataFrame(rows, index=names)


def whole(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs on all samples and all pixels of their scene."""
    return runs[(runs.asked_n == 0) & (runs.asked_d == 0)]


def split_of(lines: pd.DataFrame) -> str:
    """The split of the lines of one config, in words."""
    first = lines.iloc[0]
    keys = ("kind", "group", "test_fraction")
    return split_name({key: first.get(f"split.{key}") for key in keys})


def _kind(scene: str, origin: str) -> str:
    """The kind of the frames; of a scene whose parameters were chosen by HDC's own accuracy, so."""
    kind = kind_of(origin)
    fitted = configs.scene_display(scene)["fitted"]
    return f"{kind}, fitted to the accuracy of HDC" if fitted else kind


def _status(row: Any) -> str:
    """``ok``, or what a reader has to know."""
    notes = []
    if row.others:
        notes.append(f"{row.others} more left out: of other code or settings")
    if row.alone < row.seeds:
        notes.append(f"{row.seeds - row.alone} timed beside other runs")
    return "; ".join(notes) or "ok"


def swept(runs: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """A row for each scene, model, N and D that an experiment sweeps over and that was measured."""
    params = configs.sweep(experiment)
    sizes = (
        configs.numbers(params.get(name, ["null"]))
        for name in ("split.n_train", "data.pixels")
    )
    asked = itertools.product(params["scene"], params["model"], *sizes)
    models = {"hdc", *params["model"]}
    own = runs[runs.scene.isin(params["scene"]) & runs.model.isin(models)]
    return asked_for(of_runs(own), asked)[lambda rows: rows.seeds > 0]


def asked_for(table: pd.DataFrame, asked: Iterable[Sequence[Any]]) -> pd.DataFrame:
    """Rows of a table of runs by their names (:data:`ROW`); of those not run, names and status."""
    wanted = pd.DataFrame(list(asked), columns=ROW)
    found = wanted.merge(table.astype(dict.fromkeys(ROW[2:], int)), "left", ROW)
    missing = found.seeds.isna()
    return found.assign(
        seeds=found.seeds.mask(missing, 0), status=found.status.mask(missing, "missing")
    )[[*COLUMNS, *ROW[2:]]]


def extra_models(runs: pd.DataFrame, scene: str) -> list[str]:
    """Models on a scene that no experiment of ``configs/`` sweeps over: one's own, and models with
    changed settings."""
    found = set(runs.model[runs.scene == scene])
    return sorted(found.difference(configs.swept_models()))


def caption(data: pd.DataFrame, what: str) -> str:
    """Title of a table of runs: its content, frames, scenes and machines."""
    measured = data[data.seeds.astype(bool)]
    names = " and ".join(f"“{scene_name(scene)}”" for scene in data.scene.unique())
    if not len(measured):
        return f"{what}, scene {names}: no runs."
    machines = {
        f"{cpu}, {counted(threads, 'thread')}"
        for cpu, threads in zip(measured.cpu, measured.threads, strict=True)
    }
    kinds = frames_of(configs.scene_display(scene)["kind"] for scene in measured.scene)
    return f"{what}, {kinds}, scene {names}. {'; '.join(sorted(machines))}."


def learning(frame: pd.DataFrame) -> pd.DataFrame:
    """Test error while models learn, and after training: a row per report of a run that was tested,
    and one per model at its end.

    Args:
        frame: lines of single trainings and of their checkpoints.

    Returns:
        DataFrame: :data:`ROW`, ``record`` and ``seed`` of a report, ``at`` (``report`` or ``end``),
        ``seconds``, ``error`` (at the end with its 95 % interval), and ``n_test`` of all seeds.
    """
    runs = of_experiment(frame, RUNS)
    reports = of_experiment(frame, CHECKPOINTS)
    table = of_runs(runs)
    accuracy = table.filter(like="test_accuracy_final").astype(float)
    ends = table.assign(
        at="end",
        seconds=runs.groupby(ROW, sort=False).total_time_s.median().to_numpy(),
        error=1 - accuracy.test_accuracy_final,
        error_low=1 - accuracy.test_accuracy_final_high,
        error_high=1 - accuracy.test_accuracy_final_low,
    )
    tested = reports.dropna(subset="test_accuracy")
    while_learning = tested.assign(
        at="report", seconds=tested.training_s, error=1 - tested.test_accuracy
    )
    about = ends[[*ROW, "n_test", "split"]].astype(dict.fromkeys(ROW[2:], int))
    while_learning = while_learning.merge(about, on=ROW)
    names = [*ROW, "record", "seed", "at", "seconds", "error"]
    names += ["error_low", "error_high", "n_test", "split"]
    return pd.concat([while_learning, ends]).reindex(columns=names)
