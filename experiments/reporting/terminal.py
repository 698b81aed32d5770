"""Tables on the terminal: Table I, own models on every scene, one table that is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.records.console import printable, say
from experiments.reporting.table import Table, records

_OF_SCENES = ("scene", "model", "seeds", "test_accuracy_final", "training_time_s")
_MOST = 20  # rows
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


def show_scenes(console: Console, table: Table) -> None:
    """Own models on every scene, as many lines as a screen has."""
    show(console, replace(table, shown=_OF_SCENES), _MOST)


def show_table1(console: Console, table: Table, reference: Table | None = None) -> None:
    """Table I of a set of results: the cells of its file, and the note below them.

    Models that were not measured have the row of the reference, if there is one, in a table of its
    own, since another machine took its seconds.
    """
    measured = _cells(table, measured=True)
    theirs = _cells(reference, measured=True) if reference else {}
    theirs = {model: cells for model, cells in theirs.items() if model not in measured}
    shown = {m: cells for m, cells in _cells(table).items() if m not in theirs}
    say(console, str(table.title))
    console.print(_grid(table, shown.values(), _WIDTHS))
    if theirs:
        say(console, "Reference, on its own machine")
        console.print(_grid(table, theirs.values(), _WIDTHS))
    console.print(Text(printable(str(table.note)), "dim"))


def show_row(console: Console, table: Table, model: str, heads: bool) -> None:
    """The row of one model of Table I, below the heads of the columns if they are asked for."""
    shown = _grid(table, [_cells(table)[model]], _WIDTHS)
    shown.show_header = heads
    console.print(shown)


def _cells(table: Table, measured: bool = False) -> dict[str, list[str]]:
    """The cells of each model; of those that were measured alone if that is asked for."""
    rows = zip(records(table.data), table.cells(), strict=True)
    return {row["model"]: cells for row, cells in rows if row["seeds"] or not measured}


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


def last_line(table: Table | None, page: str) -> str:
    """The next command, and where the page is."""
    if table is not None and table.data.seeds.max() == 1:
        return f"One seed gives no interval; more seeds: make reproduce QUICK=1 · page: {page}"
    return f"page: {page}"
