"""Tables on the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.records.console import printable, say
from experiments.reporting.table import Table

LEAST_WIDTH = 16  # of a column of names, which break at spaces


def show(console: Console, table: Table, most: int | None = None) -> None:
    """A table with its title and its notes, or the first lines of it."""
    say(console, str(table.title))
    show_rows(console, table, most)
    left = len(table.data) - (most or len(table.data))
    if left > 0:
        say(console, f"{left} more: tables/{table.name}.csv")
    elif most is None:
        console.print(Text(printable(table.notes), "dim"))


def show_rows(console: Console, table: Table, most: int | None = None) -> None:
    """The heads and rows of a table, or the first rows."""
    grid = Grid(box=None, pad_edge=False, header_style="")
    for head, is_number in zip(table.heads, table.numeric(), strict=True):
        look = {"justify": "right"} if is_number else {"min_width": LEAST_WIDTH}
        grid.add_column(printable(head), **look)
    for cells in table.cells()[:most]:
        grid.add_row(*(Text(printable(cell)) for cell in cells))
    console.print(grid)
