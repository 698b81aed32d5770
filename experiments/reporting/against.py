"""Own results against the reference: which numbers are equal, within its range, or outside.

Cells of tables of one name are compared, row by row of the same key, where the trainings ended by
the same rule. A number is within where it lies between the bounds that the reference has for it.
Times in seconds are of a machine, and are not compared; ratios of times are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.reporting.columns import Column
from experiments.reporting.measured import ENDS
from experiments.reporting.table import Table, frame, records
from experiments.reporting.text import number

EQUAL, WITHIN, OUTSIDE = "equal", "within", "outside"
_SAME = 1e-5  # relative: tables have six digits
_MOST = 5  # cells outside that the terminal names; the table names all


@dataclass(frozen=True)
class Cell:
    """A number of one's own beside that of the reference and its bounds."""

    table: str
    row: str
    column: str
    own: float
    reference: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """``equal``, ``within`` or ``outside``."""
        if math.isclose(
            self.own,
            self.reference,
            rel_tol=_SAME,
            abs_tol=1e-12,
        ):
            return EQUAL
        return WITHIN if self.low <= self.own <= self.high else OUTSIDE

    def __str__(self) -> str:
        """One line."""
        own, low, high = map(number, (self.own, self.low, self.high))
        what = f"{self.table}: {self.row}: {self.column}"
        return f"{what} {own}; reference {low} to {high}"


@dataclass(frozen=True)
class Comparison:
    """Every cell that can be compared."""

    cells: Sequence[Cell]

    def of(self, verdict: str) -> list[Cell]:
        return [cell for cell in self.cells if cell.verdict == verdict]

    def lines(self) -> Iterator[str]:
        """How many cells are what, and the first that lie outside."""
        if not self.cells:
            yield "own against reference: no number of both has an interval"
            return
        counts = ", ".join(f"{len(self.of(v))} {v}" for v in (EQUAL, WITHIN, OUTSIDE))
        yield f"own against reference, {len(self.cells)} cells: {counts}"
        outside = self.of(OUTSIDE)
        yield from (f"! {cell}" for cell in outside[:_MOST])
        if len(outside) > _MOST:
            yield f"! {len(outside) - _MOST} more: tables/against_reference.csv"

    def outside_of(self, table: Table) -> list[set[str]]:
        """Of each row of a table of one's own, the heads of the columns that lie outside."""
        heads: dict[str, set[str]] = {}
        for cell in self.of(OUTSIDE):
            if cell.table == table.name:
                heads.setdefault(cell.row, set()).add(cell.column)
        rows = records(table.data)
        return [heads.get(row_name(row, table), set()) for row in rows]

    def table(self) -> Table:
        """A row a cell, those outside first."""
        rows = []
        for verdict in (OUTSIDE, WITHIN, EQUAL):
            for cell in self.of(verdict):
                line: dict[str, Any] = {
                    "table": cell.table,
                    "row": cell.row,
                    "column": cell.column,
                }
                line |= {"own": cell.own, "reference": cell.reference}
                line |= {"reference_low": cell.low, "reference_high": cell.high}
                rows.append({**line, "verdict": verdict})
        columns = {
            "table": Column("Table"),
            "row": Column("Row"),
            "column": Column("Column"),
            "own": Column("Own"),
            "reference": Column("Reference"),
            "verdict": Column("Own lies"),
        }
        note = (
            "Equal: to five digits; within: between the bounds of the reference. Trainings that "
            "ended by another rule and times in seconds are not compared."
        )
        title = next(iter(self.lines()), "").capitalize()
        shown = tuple(columns) if rows else ()
        return Table("against_reference", title, frame(rows), shown, columns, note)


def compare(own: Iterable[Table], reference: Iterable[Table]) -> Comparison:
    """The cells that tables of one's own share with those of the reference."""
    known = {table.name: table for table in reference}
    cells: list[Cell] = []
    for table in own:
        if table.key and table.name in known:
            theirs = {_key(row, table): row for row in records(known[table.name].data)}
            for row in records(table.data):
                other = theirs.get(_key(row, table), {})
                if row.get("stop") == other.get("stop"):
                    cells += _cells(table, row, other)
    return Comparison(_once(cells))


def _once(cells: Iterable[Cell]) -> list[Cell]:
    """Without the cells that another table has in the same row and column."""
    first: dict[tuple[Any, ...], Cell] = {}
    for cell in cells:
        first.setdefault((cell.row, cell.column, cell.own, cell.reference), cell)
    return list(first.values())


def _key(
    row: Mapping[str, Any],
    table: Table,
) -> tuple[Any, ...]:
    return tuple(row.get(name) for name in table.key)


def row_name(row: Mapping[str, Any], table: Table) -> str:
    """What tells a row of a table from its others, in words."""
    return ", ".join(str(key) for key in _key(row, table) if key is not None)


def _cells(
    table: Table,
    row: Mapping[str, Any],
    other: Mapping[str, Any],
) -> Iterator[Cell]:
    for name in row:
        if name.endswith(ENDS[1:]) or name == "seconds" or name.endswith("_s"):
            continue
        ours = row[name]
        values = [other.get(f"{name}{end}") for end in ENDS]
        if all(isinstance(x, int | float) for x in (ours, *values)):
            what = row_name(row, table)
            yield Cell(table.name, what, table.column(name).head, ours, *values)  # type: ignore[arg-type]
