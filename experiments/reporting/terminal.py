"""Table I on the terminal: one table, what of it lies outside the reference, what to do next."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.reporting.columns import display_name
from experiments.reporting.table import Table, records
from experiments.reporting.text import number, percent, printable


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
    """A sentence for each number of one's own that lies outside the bounds of the reference, of
    trainings that ended by the same rule."""
    known = {row["model"]: row for row in reference}
    for row in rows:
        other = known.get(row["model"], {})
        model = display_name(row["model"])
        if found := _beyond(row, other, "training_time_over_hdc", _short):
            own, low, high = found
            yield (
                f"{model} took {own} times HDC's training time (reference: {low} to {high}); one "
                "seed on a busy machine often differs that much."
            )
        same_rule = row["stop"] == other.get("stop")
        if same_rule and (found := _beyond(row, other, "test_accuracy_final", percent)):
            own, low, high = found
            yield f"{model} recognises {own} % (reference: {low} to {high} %)."


def _beyond(
    row: Mapping[str, Any],
    other: Mapping[str, Any],
    name: str,
    show: Callable[[Any], str],
) -> tuple[str, str, str] | None:
    """A number outside the bounds of the reference, and these, as texts; None of one within."""
    own, low, high = row.get(name), other.get(f"{name}_low"), other.get(f"{name}_high")
    if own is None or low is None or high is None or low <= own <= high:
        return None
    return show(own), show(low), show(high)
