"""Table I on the terminal, own models on every scene, and what to do next."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.reporting.table import Table, records
from experiments.reporting.text import printable

_OF_SCENES = ("scene", "model", "seeds", "test_accuracy_final", "training_time_s")
_MOST = 20  # rows


def show_table1(console: Console, table: Table) -> None:
    """Table I of a set of results: the cells of its file, a column a model."""
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


def show_scenes(console: Console, table: Table) -> None:
    """Own models on every scene, as many lines as a screen has."""
    shown = Grid(box=None, pad_edge=False, header_style="")
    for name in _OF_SCENES:
        shown.add_column(printable(table.column(name).head))
    rows = records(table.data)
    for row in rows[:_MOST]:
        cells = [table.column(name).text(name, row) for name in _OF_SCENES]
        shown.add_row(*(Text(printable(cell)) for cell in cells))
    console.print(Text(printable(table.title)), shown, sep="\n")
    if len(rows) > _MOST:
        console.print(f"{len(rows) - _MOST} more: tables/{table.name}.csv")


def last_line(table: Table | None, page: str) -> str:
    """What to do next, and where the page is."""
    seeds = [] if table is None else [row["seeds"] for row in records(table.data)]
    if max(seeds, default=0) == 1:
        return f"One seed decides nothing: make reproduce QUICK=1 · page: {page}"
    return f"page: {page}"
