"""Table I on the terminal: one table, what of it lies outside the reference, what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from experiments.reporting.columns import display_name
from experiments.reporting.table import Table, records
from experiments.reporting.text import counted, number, percent, printable

# Heads of the columns, group by group.
_GROUPS = (
    ("", ("Model",)),
    ("until 90 % in training", ("time", "× HDC", "test %")),
    ("afterwards", ("test %", "at", "× HDC")),
    ("paper", ("× HDC", "test %")),
)
_IN_GROUP, _BETWEEN = "  ", "    "
# What is compared with the reference: its head, and how a value is shown.
_COMPARED = {
    "training_time_over_hdc": ("× HDC", lambda value: _short(value)),
    "test_accuracy_final": ("test %", percent),
}


def show_table1(
    console: Console,
    table: Table,
    reference: Table | None = None,
) -> None:
    """Table I of a set of results: times until 90 % in training with the accuracies there, those
    after full training beside, and the paper's.

    Args:
        console: shows it.
        table: one's own, or the reference where there is no other.
        reference: what one's own is compared with: a line a number outside of its bounds.
    """
    rows = records(table.data)
    lines = [_about(rows), *_lines([_cells(row) for row in rows])]
    for line in lines:
        console.print(Text(printable(line)), soft_wrap=True)
    if reference is not None:
        for line in _outside(rows, records(reference.data)):
            console.print(Text(printable(line), "yellow"), soft_wrap=True)


def last_line(table: Table | None, page: str) -> str:
    """What to do next, and where the page is."""
    seeds = [] if table is None else [row["seeds"] for row in records(table.data)]
    if max(seeds, default=0) == 1:
        return f"One seed decides nothing: make reproduce QUICK=1 · page: {page}"
    return f"page: {page}"


def _about(rows: Sequence[Mapping[str, Any]]) -> str:
    """What the table is of, in one line."""
    first = next((row for row in rows if row["seeds"]), None)
    if first is None:
        return "Table I"
    most = max(row["seeds"] for row in rows)
    seeds = "1 seed" if most == 1 else f"{most} seeds"
    parts = (
        "Table I",
        f"{first['scene']} ({first['origin']})",
        f"{first['n_train']} train / {first['n_test'] // first['seeds']} test",
        f"{first['cpu']}, {counted(first['threads'], 'thread')}",
        seeds,
    )
    return " · ".join(map(str, parts))


def _lines(cells: Sequence[Sequence[str]]) -> Iterator[str]:
    """Heads of groups, heads of columns, and rows; numbers to the right of their columns."""
    heads = [head for _, names in _GROUPS for head in names]
    columns = zip(heads, *cells, strict=True)
    widths = [max(map(len, column)) for column in columns]
    groups = []
    start = 0
    for name, names in _GROUPS:
        width = sum(widths[start : start + len(names)])
        width += len(_IN_GROUP) * (len(names) - 1)
        groups.append(name.ljust(width))
        start += len(names)
    yield _BETWEEN.join(groups).rstrip()
    for line in (heads, *cells):
        yield _joined(line, widths)


def _joined(line: Sequence[str], widths: Sequence[int]) -> str:
    """A line of cells; the first is a name and stands left."""
    padded = [line[0].ljust(widths[0])]
    padded += [
        text.rjust(width) for text, width in zip(line[1:], widths[1:], strict=True)
    ]
    parts = []
    start = 0
    for _, names in _GROUPS:
        parts.append(_IN_GROUP.join(padded[start : start + len(names)]))
        start += len(names)
    return _BETWEEN.join(parts)


def _cells(row: Mapping[str, Any]) -> list[str]:
    """A row: model, until 90 % in training, afterwards, the paper."""
    paper = [
        _short(row["published_training_time_over_hdc"]),
        percent(row["published_test_accuracy"]),
    ]
    name = display_name(row["model"])
    if not row["seeds"]:
        return [name, str(row["status"]), *["–"] * 5, *paper]
    time = row["training_time_s"]
    at_once = not isinstance(time, str) and row["total_time_s"] <= 1.01 * time
    at_target = row["test_accuracy_at_target"]
    if at_target is None and at_once:
        at_target = row["test_accuracy_final"]
    afterwards = [
        percent(row["test_accuracy_final"]),
        _seconds(row["total_time_s"]),
        _short(row["total_time_over_hdc"]),
    ]
    if row["stop"] == "reached":  # it was not trained on
        afterwards = ["–"] * 3
    return [
        name,
        _seconds(time),
        _short(row["training_time_over_hdc"]),
        percent(at_target),
        *afterwards,
        *paper,
    ]


def _seconds(value: Any) -> str:
    return value if isinstance(value, str) else f"{_short(value)} s"


def _short(value: Any) -> str:
    """A number to two digits, three of one from ten on; nothing as a dash."""
    if value is None:
        return "–"
    return number(value, 2 if value < 10 else 3).removesuffix(".0")


def _outside(
    rows: Sequence[Mapping[str, Any]], reference: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """A line for each number of one's own that lies outside the bounds of the reference."""
    known = {row["model"]: row for row in reference}
    for row in rows:
        other = known.get(row["model"], {})
        for name, (head, show) in _COMPARED.items():
            if name == "test_accuracy_final" and row["stop"] == "reached":
                continue  # it was not trained on
            own, low, high = (
                row.get(name),
                other.get(f"{name}_low"),
                other.get(f"{name}_high"),
            )
            if own is None or low is None or high is None or low <= own <= high:
                continue
            model = _inside(display_name(row["model"]))
            yield f"! {model} {head} {show(own)}; reference {show(low)} to {show(high)}"


def _inside(name: str) -> str:
    """A name as it stands within a sentence; an abbreviation keeps its capitals."""
    return name if name[1:2].isupper() else name[:1].lower() + name[1:]
