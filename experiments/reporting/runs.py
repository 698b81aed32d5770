"""Every run in a plain table: its config, what was changed of it, and its results."""

from __future__ import annotations

from functools import partial
from typing import Any

from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.table import Table, frame
from experiments.reporting.text import number

SHOWN = ("id", "scene", "model", "overrides", "stop_rule", "n_train", "seed", "status",
         "test_accuracy_final", "training_s", "code")  # fmt: skip


def runs_table(results: Results) -> Table:
    """One row a run, finished or not; each key that was changed of the configs has a column."""
    rows: list[dict[str, Any]] = []
    done = [(run.record, run.overrides, run.outdated) for run in results.runs]
    for record, overrides, changed in [*done, *((r, {}, []) for r in results.unfinished)]:
        row = {
            "id": record.id,
            "scene": record.choices.scene,
            "model": record.choices.model,
            "overrides": " ".join(f"{key}={value}" for key, value in overrides.items()),
            "stop_rule": record.choices.stop,
            "n_train": getattr(record, "n_train", record.config["split"]["n_train"]),
            "pixels": record.config["data"]["pixels"],
            "seed": record.seed,
            "status": ": ".join(filter(None, [record.status, record.error])),
            "test_accuracy_final": getattr(record, "test_accuracy_final", None),
            "training_s": record.training_s,
            "origin": record.scene.origin,
            "cpu": record.environment.cpu,
            "threads": record.environment.threads,
            "exclusive": record.environment.exclusive,
            "code": ", ".join(changed) or "current",
            "command": record.command,
        }
        rows.append(row | dict(overrides))
    rows.sort(key=lambda row: (row["scene"], row["model"], row["id"]))
    four = {name: Column(name.replace("_", " "), partial(number, digits=4)) for name in SHOWN}
    note = "tables/runs.csv has a column for every key that was changed, processor and command."
    return Table("runs", "Every run", frame(rows), SHOWN if rows else (), four, note)
