"""Rows of tables of runs: values by column, what stands around such a table, and every run."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.results import Results
from experiments.records.rows import Row
from experiments.reporting.columns import COLUMNS, Column
from experiments.reporting.estimates import Estimate
from experiments.reporting.table import Table, frame
from experiments.reporting.text import counted, frames_of, number


def row(group: Group, hdc: Group) -> Row:
    """Values of every column of :data:`COLUMNS` that follows from runs, `hdc` of HDC on the same
    frames; a group without runs has its scene, model, place in the sweep and status."""
    if not group.runs:
        return {
            "scene": group.scene,
            "model": group.model,
            "n_train": group.n_train,
            "pixels": group.pixels,
            "seeds": 0,
            "status": group.status,
        }
    values: Row = {}
    for name, column in COLUMNS.items():
        if column.of is not None:
            value = column.of(group, hdc)
            values |= (
                value.columns(name) if isinstance(value, Estimate) else {name: value}
            )
    return values


def swept(runs: Groups, experiments: Sequence[str]) -> list[Row]:
    """A row for each scene, model, N and D that the experiments sweep over, measured or not."""
    rows: dict[tuple[Any, ...], Row] = {}
    for experiment in experiments:
        params = configs.sweep(experiment)
        sizes = (
            configs.numbers(params.get(k, ["null"]))
            for k in ("split.n_train", "data.pixels")
        )
        every: Iterable[Any] = itertools.product(
            params["scene"], params["model"], *sizes
        )
        for scene, model, *size in every:
            hdc = runs.group(scene, "hdc", *size)
            rows[scene, model, *size] = row(runs.group(scene, model, *size), hdc)
    return list(rows.values())


def caption(rows: Sequence[Mapping[str, Any]], what: str) -> str:
    """Caption of a table: its content, frames and machine."""
    scene = " and ".join(dict.fromkeys(f"“{line['scene']}”" for line in rows))
    used = {
        f"{line['cpu']}, {counted(line['threads'], 'thread')}"
        for line in rows
        if line.get("cpu")
    }
    if not any(line["seeds"] for line in rows):
        return f"{what}, scene {scene}: no runs."
    text = f"{what}, {frames_of(rows)}, scene {scene}."
    return f"{text} {'; '.join(sorted(used))}." if used else text


SHOWN = (
    "id",
    "scene",
    "model",
    "overrides",
    "seed",
    "status",
    "test_accuracy_final",
    "training_s",
)


def runs_table(results: Results) -> Table:
    """One row per run, finished or not; each key that was changed of the configs has a column."""
    rows: list[dict[str, Any]] = []
    done = [(run, run.differences, run.outdated) for run in results.runs]
    for record, overrides, changed in [
        *done,
        *((r, {}, []) for r in results.unfinished),
    ]:
        environment = record.environment
        rows.append(
            {
                "id": record.id,
                "scene": record.choices.scene,
                "model": record.choices.model,
                "overrides": " ".join(
                    f"{key}={value}" for key, value in overrides.items()
                ),
                "stop_rule": record.choices.stop,
                "n_train": getattr(
                    record, "n_train", record.config["split"]["n_train"]
                ),
                "pixels": record.config["data"]["pixels"],
                "seed": record.seed,
                "status": ": ".join(filter(None, [record.status, record.error])),
                "test_accuracy_final": getattr(record, "test_accuracy_final", None),
                "training_s": record.training_s,
                "origin": record.scene.origin,
                "cpu": environment.cpu,
                "threads": environment.threads,
                "exclusive": environment.exclusive,
                "code": ", ".join(changed) or "current",
                "command": record.command,
                **overrides,
            }
        )
    rows.sort(key=lambda row: (row["scene"], row["model"], row["id"]))
    four = {
        name: Column(name.replace("_", " "), partial(number, digits=4))
        for name in SHOWN
    }
    note = "tables/runs.csv has a column for every key that was changed, processor and command."
    return Table(
        "runs",
        title="Every run",
        note=note,
        columns=four,
        shown=SHOWN if rows else (),
        data=frame(rows),
    )
