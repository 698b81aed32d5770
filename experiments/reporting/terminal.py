"""Table I on the terminal: one table, what of it lies outside the reference, what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.reporting.columns import display_name
from experiments.reporting.table import Table, records
from experiments.reporting.text import number, percent, printable

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
    """Table I of a set of results: the cells of its file, a column a model.

    Args:
        console: shows it.
        table: one's own, or the reference where there is no other.
        reference: what one's own is compared with: a line a number outside of its bounds.
    """
    console.print(Text(printable(table.title)), soft_wrap=True)
    shown = Grid(box=None, pad_edge=False, header_style="")
    columns = zip(table.heads, *table.cells(), strict=True)
    for k, (head, *cells) in enumerate(columns):
        if k == 0:  # the models, one beside another: a head of a column is a sentence
            shown.add_column(printable(head))
            for cell in cells:
                shown.add_column(printable(cell), justify="right")
            continue
        # An interval stands below its value.
        texts = [printable(cell).replace(" [", "\n[") for cell in cells]
        shown.add_row(Text(printable(head)), *(Text(t, no_wrap=True) for t in texts))
    console.print(shown)
    if reference is not None:
        for line in _outside(records(table.data), records(reference.data)):
            console.print(Text(printable(line), "yellow"), soft_wrap=True)


def last_line(table: Table | None, page: str) -> str:
    """What to do next, and where the page is."""
    seeds = [] if table is None else [row["seeds"] for row in records(table.data)]
    if max(seeds, default=0) == 1:
        return f"One seed decides nothing: make reproduce QUICK=1 · page: {page}"
    return f"page: {page}"


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
