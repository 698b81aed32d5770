"""Table I, and error against run time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group, Groups
from experiments.records.results import RUNS
from experiments.reporting import estimates
from experiments.reporting import rows as rows_of
from experiments.reporting.columns import Column
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.rows import row
from experiments.reporting.study import RUN, Numbers, Plot, Quantity, Study
from experiments.reporting.table import Table, records
from experiments.reporting.text import counted
from experiments.studies.table1 import columns, equal, figure, models
from experiments.studies.table1.models import PAPER
from experiments.studies.table1.rows import table1
from experiments.studies.table1.times import grid
from experiments.studies.table1.times import view as times_view

KEY = ("scene", "model", "n_train", "pixels")


def _title(lines: pd.DataFrame) -> str:
    """Caption of Table I: its content, frames and machine."""
    data = table1(lines)
    rows = [] if data is None else records(data)
    return rows_of.caption(rows, "Table I, published and measured")


def quantities(lines: pd.DataFrame) -> Iterator[Quantity]:
    """Times and accuracies of Table I, in seconds and percent, and the learning rate."""
    runs = Groups.of(lines)
    groups = {model: runs.group(models.scene(), model) for model in PAPER}
    for model, group in groups.items():
        if not group.runs:
            continue
        line, name = row(group, group), f"table1/{model}"
        seeds: dict[str, Any] = {
            "seeds": len(group.runs),
            "made_by": " && ".join(group.commands),
        }
        n_runs = len(group.runs)
        note = f"median; {line['cpu']}, {counted(line['threads'], 'thread')}; paper: Apple M1"
        time = line["training_time_s"]
        yield Quantity(f"{name}_training_time", time, n=n_runs, note=note, **seeds)
        if model == "hdc":
            yield Quantity.of(
                f"{name}_test_accuracy",
                estimates.share_of_one_sensor(group),
                ONE_SENSOR,
                100,
                n=line["n_test"],
                **seeds,
            )
            yield Quantity("touch/labels", len(group.classes), made_by=f"{RUN}table1")
            continue
        yield from _ratios(lines, model)
        for kind, called, n in (
            ("train", "training", line["n_train"] * n_runs),
            ("test", "test", line["n_test"]),
        ):
            best = line[f"{kind}_accuracy_max"]
            final = line[f"{kind}_accuracy_final"]
            if best is not None:
                note = f"maximum of a run, as published; {100 * final:.4g} % at its end"
                yield Quantity(
                    f"{name}_{called}_accuracy",
                    100 * best,
                    n=n,
                    note=note,
                    **seeds,
                )
    yield from _learning_rate(groups)


def _learning_rate(groups: Mapping[str, Group]) -> Iterator[Quantity]:
    """That of the iterative models, where it is one."""
    rates = set()
    for model, group in groups.items():
        if model != "hdc":
            rates |= {run.config["model"]["lr"] for run in group.runs}
    if len(rates) == 1:
        yield Quantity(
            "table1/learning_rate",
            rates.pop(),
            note="softmax and CNNs",
            made_by=f"{RUN}table1",
        )


def _ratios(lines: pd.DataFrame, model: str) -> Iterator[Quantity]:
    """Training time relative to HDC by each implementation of both."""
    for line in grid.every_line(lines):
        if line["model"] != model:
            continue
        values = (line["ratio"], line["ratio_low"], line["ratio_high"])
        value, low, high = (v if np.isfinite(v) else None for v in values)
        yield Quantity(
            f"table1/{model}_time_over_hdc",
            value,
            low,
            high,
            "median over runs" if low is not None else "",
            grid.WAYS[line["way"]],
            n=line["runs"],
            made_by=line["command"],
            note="" if model == "softmax" else "the network's sizes are ours",
        )


STUDY = Study(
    "table1",
    "Table I",
    "Is HDC more accurate than softmax regression and convolutional networks, and does it "
    "train in a hundredth of their time? Five labels, N = 400.",
    order=1,
    front=True,
    tables=[
        *times_view.TABLES,
        Table(
            "table1",
            table1,
            of=RUNS,
            title=_title,
            note=columns.note,
            key=KEY,
            shown=columns.SHOWN,
            columns=columns.COLUMNS,
            commands=[f"{RUN}table1", f"{RUN}table1_descent"],
        ),
        Table(
            "equal_accuracy",
            equal.equal_accuracy,
            of=RUNS,
            title="Time to reach the test accuracy of HDC",
            key=("model", "pixels"),
            columns={
                "time": Column("Time to the test accuracy of HDC, s", equal.or_never),
                "ratio": Column("× HDC", equal.or_never),
            },
            note="Rule: a model is as accurate as HDC at its first report of at least the test "
            "accuracy that HDC of the same seed ends with; never, if it stops before. One-pass "
            "models report when they are fitted. × HDC: relative to HDC that was trained just "
            "before and just after; where none was, to its run of the same seed on the same "
            "machine. Median [lowest, highest] over seeds. Fewer pixels: the fewest with which "
            "every seed gets there.",
            commands=[f"{RUN}table1", f"{RUN}table1_extended", f"{RUN}accuracy_vs_d"],
        ),
    ],
    figures=[
        *times_view.FIGURES,
        Plot(
            "error_vs_time",
            figure.error_vs_time,
            of=RUNS,
            caption="Test error against training time relative to HDC (Table I): one curve "
            "per model and seed, with a marker where training accuracy exceeds 90 %. "
            "Bars: 95 %, after full training. Stars: the paper.",
            size=(3.4, 5.4),
            needs=lambda lines: bool(
                Groups.of(lines).group(models.scene(), "hdc").runs
            ),
            commands=[f"{RUN}table1", f"{RUN}table1_extended"],
        ),
    ],
    numbers=[Numbers(quantities, of=grid.OF)],
)
