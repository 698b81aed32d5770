"""Table I on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table as TerminalTable
from rich.text import Text

from experiments.reporting.columns import display_name
from experiments.reporting.table import Table, records
from experiments.reporting.text import number, percent, printable


def show_table1(
    console: Console,
    table: Table,
    name: str,
) -> None:
    """Table I of a set of results: times until 90 % in training with the accuracies there, those
    after full training beside, and the paper's."""
    rows = records(table.data)
    shown = TerminalTable(title=_about_table1(rows, name), box=box.SIMPLE_HEAD)
    shown.add_column("\nModel")
    for head in (
        "until 90 %\ntime",
        "in training\n× HDC",
        "\ntest %",
        "afterwards\ntest %",
        "\nat",
        "paper\n× HDC",
        "\ntest %",
    ):
        shown.add_column(head, justify="right")
    for row in rows:
        shown.add_row(*(Text(printable(cell)) for cell in _cells_of_table1(row)))
    console.print(shown)


def _about_table1(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """What the table is of, in one line."""
    first = next((row for row in rows if row["seeds"]), None)
    if first is None:
        return f"Table I, {name}"
    most = max(row["seeds"] for row in rows)
    seeds = "1 seed" if most == 1 else f"{most} seeds"
    parts = (
        f"Table I, {name}",
        f"{first['scene']} ({first['origin']})",
        f"{first['n_train']} train / {first['n_test'] // first['seeds']} test",
        f"{first['cpu']}, {first['threads']} threads",
        seeds,
    )
    return printable(" · ".join(map(str, parts)))


def _cells_of_table1(row: Mapping[str, Any]) -> list[str]:
    """A row: model, until 90 % in training, afterwards, the paper."""
    paper = [
        number(row["published_training_time_over_hdc"]),
        percent(row["published_test_accuracy"]),
    ]
    if not row["seeds"]:
        return [display_name(row["model"]), str(row["status"]), *["–"] * 4, *paper]
    time = row["training_time_s"]
    at_once = not isinstance(time, str) and row["total_time_s"] <= 1.01 * time
    at_target = row["test_accuracy_at_target"]
    if at_target is None and at_once:
        at_target = row["test_accuracy_final"]
    final, seconds = percent(row["test_accuracy_final"]), _seconds(row["total_time_s"])
    if row["stop"] == "reached":  # it was not trained on
        final = seconds = "–"
    return [
        display_name(row["model"]),
        _seconds(time),
        number(row["training_time_over_hdc"]),
        percent(at_target),
        final,
        seconds,
        *paper,
    ]


def _seconds(value: Any) -> str:
    return value if isinstance(value, str) else f"{number(value)} s"
