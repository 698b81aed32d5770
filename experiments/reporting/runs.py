"""Every run in a plain table: what it was, what was changed of the configs, what came of it."""

from __future__ import annotations

from functools import partial

from experiments.records.results import Results
from experiments.reporting.table import Table, cell, frame, number

COLUMNS = (
    "id",
    "scene",
    "model",
    "overrides",
    "stop_rule",
    "n_train",
    "pixels",
    "seed",
    "status",
    "test_accuracy_final",
    "training_s",
    "origin",
    "cpu",
    "threads",
    "exclusive",
    "code",
    "command",
)
CSV_ALONE = ("pixels", "origin", "cpu", "threads", "exclusive", "command")


def runs_table(results: Results) -> Table:
    """One row a run, finished or not, whatever its configuration."""
    rows = []
    done = [(run.record, run.overrides, run.outdated) for run in results.runs]
    for record, overrides, changed in [*done, *((r, {}, []) for r in results.unfinished)]:
        config = record.config
        rows.append(
            {
                "id": record.id,
                "scene": record.choices.scene,
                "model": record.choices.model,
                "overrides": " ".join(f"{key}={value}" for key, value in overrides.items()),
                "stop_rule": record.choices.stop,
                "n_train": getattr(record, "n_train", config["split"]["n_train"]),
                "pixels": config["data"]["pixels"],
                "seed": record.seed,
                "status": record.status
                if record.error is None
                else f"{record.status}: {record.error}",
                "test_accuracy_final": getattr(record, "test_accuracy_final", None),
                "training_s": getattr(record, "training_s", None),
                "origin": record.scene.origin,
                "cpu": record.environment.cpu,
                "threads": record.environment.threads,
                "exclusive": record.environment.exclusive,
                "code": ", ".join(changed) or "current",
                "command": record.command,
            }
        )
    rows.sort(key=lambda row: (row["scene"], row["model"], row["id"]))
    shown = [name for name in COLUMNS if name not in CSV_ALONE]
    return Table(
        "runs",
        "Every run",
        frame(rows, COLUMNS),
        {name.replace("_", " "): cell(name, partial(number, digits=4)) for name in shown},
        "With processor, threads and command in tables/runs.csv.",
    )
