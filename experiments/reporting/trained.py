"""Trainings as rows: a row for each scene, model, number of samples and of pixels.

Times are medians over seeds, accuracies means. A mean of a quantity that some runs lack has the
number of those that have it beside it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import ROW
from experiments.reporting import estimates
from experiments.reporting.columns import scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import counted, frames_of, kind_of, split_name

MACHINE = ["cpu", "threads"]
_MEDIANS = ["training_time_s", "total_time_s", "predict_single_s"]
_MEANS = ["train_accuracy_at_target", "test_accuracy_at_target", "train_accuracy_final"]
_FIRST = ["n_train", "stop_rule", "n_classes", "code", "others"]
_SAME = ["model_bytes", *MACHINE]
# Seconds: of a row whose runs were not alone on the machine they are left out.
_SECONDS = ["at_least_s", *_MEDIANS]
COLUMNS = [
    *("scene", "model", "n_train", "pixels", "seeds", "stop", "stop_rule", "status"),
    *("training_time_s", "at_least_s", "total_time_s"),
    *("train_accuracy_at_target", "test_accuracy_at_target", "seeds_at_target"),
    "train_accuracy_final",
    *("test_accuracy_final", "test_accuracy_final_low", "test_accuracy_final_high"),
    *("n_test", "over_hdc", "over_hdc_low", "over_hdc_high", "model_bytes"),
    *("predict_single_s", "origin", "split"),
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


def extra_models(runs: pd.DataFrame, scene: str) -> list[str]:
    """Models on a scene that no experiment of ``configs/`` sweeps over: one's own, and models with
    changed settings."""
    found = set(runs.model[runs.scene == scene])
    return sorted(found.difference(configs.swept_models()))


def caption(data: pd.DataFrame, what: str) -> str:
    """Title of a table of runs: its content, frames, scenes and machines."""
    names = " and ".join(f"“{scene_name(scene)}”" for scene in data.scene.unique())
    machines = {
        f"{cpu}, {counted(threads, 'thread')}"
        for cpu, threads in zip(data.cpu, data.threads, strict=True)
    }
    kinds = frames_of(configs.scene_display(scene)["kind"] for scene in data.scene)
    return f"{what}, {kinds}, scene {names}. {'; '.join(sorted(machines))}."
