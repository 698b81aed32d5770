"""Table I on the terminal, own models on every scene, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.reporting.table import Table, records
from experiments.reporting.text import printable

_OF_SCENES = ("scene", "model", "seeds", "test_accuracy_final", "training_time_s")
_MOST = 20  # rows
_WIDTHS = (23, 13, 12, 10, 13, 10, 9)  # of the columns of Table I: less than 100 signs


def show_table1(console: Console, table: Table, reference: Table | None = None) -> None:
    """Table I of a set of results: the cells of its file, and the note below them.

    Rows that were not measured are those of the reference, and are marked, if it has them.
    """
    console.print(Text(printable(table.title)), soft_wrap=True)
    shown = _grid(table)
    for cells in _with_reference(table, reference):
        _add(shown, cells)
    console.print(shown)
    console.print(Text(printable(table.note), "dim"))


def show_row(console: Console, table: Table, model: str, heads: bool) -> None:
    """The row of one model of Table I, below the heads of the columns if they are asked for."""
    shown = _grid(table)
    shown.show_header = heads
    for row, cells in _rows(table):
        if row["model"] == model:
            _add(shown, cells)
    console.print(shown)


def _grid(table: Table) -> Grid:
    """Columns of equal width whatever the rows, so that rows may follow one by one."""
    shown = Grid(box=None, pad_edge=False, header_style="")
    shown.add_column(printable(table.heads[0]), width=_WIDTHS[0])
    for head, width in zip(table.heads[1:], _WIDTHS[1:], strict=True):
        shown.add_column(printable(head), justify="right", width=width)
    return shown


def _add(shown: Grid, cells: Sequence[str]) -> None:
    """Add a row; an interval stands below its value."""
    shown.add_row(*(Text(printable(cell).replace(" [", "\n[")) for cell in cells))


def _with_reference(table: Table, reference: Table | None) -> Iterator[list[str]]:
    theirs = {} if reference is None else _measured(reference)
    ours = _measured(table)
    for row, cells in _rows(table):
        name, *values = cells
        model = row["model"]
        if model not in ours and model in theirs:
            values = theirs[model][1:]
            name += " (reference)"
        yield [name, *values]
    known = {row["model"] for row, _ in _rows(table)}
    for model, (name, *values) in theirs.items():
        if model not in known:
            yield [f"{name} (reference)", *values]


def _measured(table: Table) -> dict[str, list[str]]:
    return {row["model"]: cells for row, cells in _rows(table) if row["seeds"]}


def _rows(table: Table) -> Iterator[tuple[dict[str, Any], list[str]]]:
    """The values and the cells of each row."""
    yield from zip(records(table.data), table.cells(), strict=True)


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
