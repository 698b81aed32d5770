"""Tables on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.records.console import printable, say
from experiments.reporting.table import Table

LEAST_WIDTH = 16  # of a column of names, which break at spaces
OF_TABLE1 = (23, 13, 12, 10, 13, 10, 9)
"""Widths of the columns of Table I, so that its rows may follow one by one; under 100 in all."""


def show(
    console: Console,
    table: Table,
    most: int | None = None,
    widths: Sequence[int] = (),
) -> None:
    """A table with its title and its notes, or the first lines of it."""
    say(console, str(table.title))
    show_rows(console, table, most, widths)
    left = len(table.data) - (most or len(table.data))
    if left > 0:
        say(console, f"{left} more: tables/{table.name}.csv")
    elif most is None:
        console.print(Text(printable(table.notes), "dim"))


def show_rows(
    console: Console,
    table: Table,
    most: int | None = None,
    widths: Sequence[int] = (),
    heads: bool = True,
) -> None:
    """The rows of a table, or the first ones, below its heads if they are asked for. Where widths
    are given, an interval stands below its value."""
    grid = Grid(box=None, pad_edge=False, header_style="", show_header=heads)
    for k, (head, is_number) in enumerate(
        zip(table.heads, table.numeric(), strict=True)
    ):
        look: dict[str, Any] = (
            {"justify": "right"} if is_number else {"min_width": LEAST_WIDTH}
        )
        if widths:
            look = {"justify": "right" if k else "left", "width": widths[k]}
        grid.add_column(printable(head), **look)
    for cells in table.cells()[:most]:
        texts = [printable(cell) for cell in cells]
        if widths:
            texts = [text.replace(" [", "\n[") for text in texts]
        grid.add_row(*map(Text, texts))
    console.print(grid)
