"""Tables on the terminal: Table I, a row of it, one table that is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.records.console import printable, say
from experiments.reporting.table import Table, records

_WIDTHS = (23, 13, 12, 10, 13, 10, 9)  # of the columns of Table I: less than 100 signs


def show(console: Console, table: Table, most: int | None = None) -> None:
    """A table with its title and its note, or the first lines of it."""
    cells = table.cells()
    say(console, str(table.title))
    console.print(_grid(table, cells[:most]))
    if most is not None and len(cells) > most:
        say(console, f"{len(cells) - most} more: tables/{table.name}.csv")
    elif most is None:
        console.print(Text(printable(table.notes), "dim"))


def show_table1(console: Console, table: Table) -> None:
    """Table I: the models that were measured, and the note below them."""
    say(console, str(table.title))
    console.print(_grid(table, _measured(table).values(), _WIDTHS))
    console.print(Text(printable(str(table.note)), "dim"))


def show_row(console: Console, table: Table, model: str, heads: bool) -> None:
    """The row of one model of Table I, below the heads of the columns if they are asked for."""
    row = _measured(table).get(model)
    shown = _grid(table, [row] if row else [], _WIDTHS)
    shown.show_header = heads
    console.print(shown)


def _measured(table: Table) -> dict[str, list[str]]:
    """The cells of each model that was measured."""
    rows = zip(records(table.data), table.cells(), strict=True)
    return {row["model"]: cells for row, cells in rows if row["seeds"]}


def _grid(
    table: Table, rows: Iterable[Sequence[str]], widths: Sequence[int] = ()
) -> Grid:
    """Rows below the heads. An interval stands below its value where widths are given: columns are
    as wide whatever the rows, so that rows may follow one by one."""
    shown = Grid(box=None, pad_edge=False, header_style="")
    for k, head in enumerate(table.heads):
        shown.add_column(
            printable(head),
            justify="right" if widths and k else "left",
            width=widths[k] if widths else None,
        )
    for cells in rows:
        texts = [printable(cell) for cell in cells]
        if widths:
            texts = [text.replace(" [", "\n[") for text in texts]
        shown.add_row(*map(Text, texts))
    return shown
