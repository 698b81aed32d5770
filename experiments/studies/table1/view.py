"""Table I, its sister of few samples, and error against run time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.groups import Group, Groups
from experiments.records.results import RUNS
from experiments.reporting import estimates
from experiments.reporting import rows as rows_of
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.estimates import ONE_SENSOR, median_range
from experiments.reporting.measured import ENDS
from experiments.reporting.rows import row
from experiments.reporting.study import (
    RUN,
    FigureOf,
    NumbersOf,
    Quantity,
    Study,
    TableOf,
)
from experiments.reporting.table import frame, records
from experiments.reporting.text import counted, number, percent
from experiments.studies.table1 import equal, figure, models
from experiments.studies.table1.models import LINES, PAPER
from experiments.studies.table1.times import grid
from experiments.studies.table1.times import view as times_view

# Training samples on a scene, five of each class: no model is near 100 %.
FEW = {"touch": 25, "finger": 35}
# The rules that end a training before its loss has converged.
NOT_FINISHED = ("budget", "steps", "diverged")


def _trained(cells: Mapping[str, Any]) -> str:
    """Test accuracy after full training, or why there is none."""
    if not cells["seeds"]:
        return str(cells["status"])
    if cells["stop"] == "reached":
        return "not continued"
    low, high = cells["test_accuracy_final_low"], cells["test_accuracy_final_high"]
    text = f"{percent(cells['test_accuracy_final'])} [{percent(low)}, {percent(high)}]"
    if any(reason in str(cells["stop"]) for reason in NOT_FINISHED):
        return f"not finished: {text}"
    return text


def _afterwards(name: str) -> Column:
    """A column of what a full training took; nothing of one that was not continued."""
    head = {"total_time_s": "at, s", "total_time_over_hdc": "× HDC"}[name]

    def cell(cells: Mapping[str, Any]) -> str:
        if not cells["seeds"] or cells["stop"] == "reached":
            return "–"
        return number(cells[name])

    return Column(f"Afterwards: {head}", cell=cell)


COLUMNS = {
    "training_time_s": Column(
        "Until 90 % in training: time, s",
        note="Until 90 % in training: iterative models are timed until their training accuracy "
        "exceeds 90 %, as in the paper; one-pass models until fitted.",
    ),
    "training_time_over_hdc": Column(
        "× HDC [interval]",
        note="Time and × HDC are medians over turns in one process, HDC before and after each "
        "training, where the grid of times was measured; else over seeds. Brackets: two of the "
        "ratios measured; how surely the median lies between them is in the column coverage of the "
        "table's CSV. Afterwards × HDC is the quotient of the times shown.",
    ),
    "trained": Column(
        "Afterwards: test, % [95 % interval]",
        cell=_trained,
        note="Intervals of accuracies: Student over seeds, never narrower than the test set "
        "allows; Wilson for one seed.",
    ),
    "total_time_s": _afterwards("total_time_s"),
    "total_time_over_hdc": _afterwards("total_time_over_hdc"),
    "published_training_time_over_hdc": Column("Paper: × HDC"),
    "published_test_accuracy": Column("Paper: test, %", percent),
}
SHOWN = (
    *("model", "training_time_s", "training_time_over_hdc", "test_accuracy_at_target"),
    *("trained", "total_time_s", "total_time_over_hdc"),
)
OF_PAPER = ("published_training_time_over_hdc", "published_test_accuracy")
KEY = ("scene", "model", "n_train", "pixels")


def rows_of_table(
    of: pd.DataFrame,
    place: str,
    n_train: int | None = None,
    paper: bool = True,
) -> pd.DataFrame | None:
    """A row for each model of Table I on a scene; None where none was run."""
    runs = Groups.of(of)
    names = [*LINES]
    if n_train is None:
        names += runs.extra_models(place)
    groups = [runs.group(place, name, n_train) for name in names]
    hdc = groups[0]
    times = grid.default_times(of, hdc)
    lines = [
        row(group, hdc, paper=paper) | _times_of(group, hdc, times) for group in groups
    ]
    measured = [line for line in lines if line["seeds"]]
    if not measured:
        return None
    hdc_s = lines[0].get("training_time_s")
    if hdc_s:
        for line in measured:
            line["total_time_over_hdc"] = line["total_time_s"] / hdc_s
    shown = [line for line in lines if line["seeds"] or line["model"] in PAPER]
    return frame(shown)


def _columns(data: pd.DataFrame) -> dict[str, Column]:
    return {**COLUMNS, "test_accuracy_at_target": _reached(records(data))}


def _reached(lines: Sequence[Mapping[str, Any]]) -> Column:
    """The column of test accuracies when training passes 90 %, whose head says what was passed."""
    shares = [line.get("train_accuracy_at_target") for line in lines]
    found = [percent(share) for share in sorted(filter(None, shares))]
    head = "Test, %, there"
    if found:
        ends = " to ".join(dict.fromkeys((found[0], found[-1])))
        head += f" (training accuracy {ends} %)"
    return Column(head, percent)


def _times_of(
    group: Group,
    hdc: Group,
    times: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    """Time and ratio to HDC of a row: in turns where they were measured so, else over seeds."""
    if not group.runs:
        return {}
    if group.model == "hdc":
        seconds = times["hdc"]["seconds"] if "hdc" in times else None
        return {"training_time_s": seconds} if seconds else {}
    if group.model in times:
        line = times[group.model]
        found = {"training_time_s": line["seconds"], "turns": line["turns"]}
        for end in ENDS:
            found[f"training_time_over_hdc{end}"] = line[f"ratio{end}"]
        return {**found, "coverage": line["coverage"]}
    ratios = _ratios_of_seeds(group, hdc)
    if not ratios:
        return {}
    ratio, coverage = median_range(ratios)
    return {
        "training_time_over_hdc": ratio.value if np.isfinite(ratio.value) else None,
        "training_time_over_hdc_low": ratio.low,
        "training_time_over_hdc_high": ratio.high,
        "coverage": coverage,
    }


def _ratios_of_seeds(group: Group, hdc: Group) -> list[float]:
    """Training times over HDC's of the same seed; none where they are of several machines."""
    if group.machines != hdc.machines or len(group.machines) != 1:
        return []
    beside = {run.seeds: estimates.training_time(run) for run in hdc.runs}
    return [
        estimates.training_time(run) / beside[run.seeds]
        for run in group.runs
        if run.seeds in beside
    ]


def table1(lines: pd.DataFrame) -> pd.DataFrame | None:
    """Table I, and below it the same softmax regression solved directly and one's own models."""
    return rows_of_table(lines, models.scene())


def _title(lines: pd.DataFrame) -> str:
    """What Table I shows, on which frames, on which machine."""
    data = table1(lines)
    rows = [] if data is None else records(data)
    return rows_of.caption(rows, "Table I, published and measured")


def table1_few(lines: pd.DataFrame) -> pd.DataFrame | None:
    """The same rows from few samples, on two scenes; only models that were run, and only where the
    published rival was."""
    runs, parts = Groups.of(lines), []
    for place, n_train in FEW.items():
        data = rows_of_table(lines, place, n_train, paper=False)
        if data is not None and runs.group(place, "softmax", n_train).runs:
            parts.append(data[data.seeds > 0])
    return pd.concat(parts, ignore_index=True) if parts else None


def _columns_of_few(data: pd.DataFrame) -> dict[str, Column]:
    return {**_columns(data), "scene": Column("Scene", scene_name)}


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
            "made_by": " && ".join(rows_of.commands([group])),
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
        yield from _ratios(lines, group)
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
            rates |= {run.record.config["model"]["lr"] for run in group.runs}
    if len(rates) == 1:
        yield Quantity(
            "table1/learning_rate",
            rates.pop(),
            note="softmax and CNNs",
            made_by=f"{RUN}table1",
        )


def _ratios(lines: pd.DataFrame, group: Group) -> Iterator[Quantity]:
    """Training time over HDC's by each way of computing both; of one's own first look, by that of
    the runs."""
    name = f"table1/{group.model}_time_over_hdc"
    note = "" if group.model == "softmax" else "the network's sizes are ours"
    measured = grid.beside(lines, group)
    if not len(measured):
        hdc = Groups.of(lines).group(group.scene, "hdc")
        ratios = _ratios_of_seeds(group, hdc)
        finite = bool(ratios) and bool(np.isfinite(ratios).all())
        values = median_range(ratios)[0] if finite else (None, None, None)
        how, way = "median over seeds", grid.WAYS[grid.DEFAULT]
        yield _ratio(name, values, how, way, len(ratios), "table1", note)
        return
    for line in records(measured):
        if line["model"] == group.model:
            values = (line["ratio"], line["ratio_low"], line["ratio_high"])
            how, way = "median over turns", grid.WAYS.get(line["way"], line["way"])
            yield _ratio(name, values, how, way, line["turns"], grid.NAME, note)


def _ratio(
    name: str,
    values: tuple[float | None, float | None, float | None],
    how: str,
    condition: str,
    n: int,
    experiment: str,
    note: str,
) -> Quantity:
    """A ratio of times with its interval; None where it is not finite."""
    found = [v if v is not None and np.isfinite(v) else None for v in values]
    value, low, high = found
    return Quantity(
        name,
        value,
        low,
        high,
        how if low is not None else "",
        condition,
        n=n or None,
        seeds=n or None,
        made_by=f"{RUN}{experiment}",
        note=note,
    )


OF = (RUNS, grid.NAME)  # the runs of Table I, and the grid of times beside them
STUDY = Study(
    "table1",
    "Table I",
    "Does HDC recognise touches better than softmax regression and convolutional networks, and "
    "train in a hundredth of their time? Five labels, N = 400.",
    order=1,
    front=True,
    tables=[
        *times_view.TABLES,
        TableOf(
            "table1",
            table1,
            of=OF,
            title=_title,
            key=KEY,
            shown=(*SHOWN, *OF_PAPER, "seeds"),
            columns=_columns,
            commands=[f"{RUN}table1"],
        ),
        TableOf(
            "table1_few",
            table1_few,
            of=OF,
            title="Table I where no model is near 100 %: five training samples of each class",
            key=KEY,
            shown=("scene", *SHOWN, "over_hdc", "seeds"),
            columns=_columns_of_few,
            commands=[f"{RUN}table1_few"],
        ),
        TableOf(
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
            "models report when they are fitted. × HDC: over the time of HDC of the same seed, on "
            "the same machine. Median [lowest, highest] over seeds. Fewer pixels: the fewest with "
            "which every seed gets there.",
            commands=[f"{RUN}table1", f"{RUN}table1_extended", f"{RUN}accuracy_vs_d"],
        ),
    ],
    figures=[
        *times_view.FIGURES,
        FigureOf(
            "error_vs_time",
            figure.error_vs_time,
            of=RUNS,
            caption="Test error against training time over that of HDC (Table I): one curve per "
            "model and seed, with its marker where training accuracy passed 90 %. Bars: 95 %, "
            "after full training. Stars: the paper's, over the time of its HDC.",
            size=(3.4, 3.9),
            needs=lambda lines: bool(
                Groups.of(lines).group(models.scene(), "hdc").runs
            ),
            commands=[f"{RUN}table1", f"{RUN}table1_extended"],
        ),
    ],
    numbers=[NumbersOf(quantities, of=OF)],
)
