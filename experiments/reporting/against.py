"""Own results beside the reference: cells of tables of one name, row by row of the same key.

A number differs where its interval, or the number itself if it has none, lies outside the interval
of the reference. Trainings that another stopping rule ended are not compared, and no time in
seconds is: it belongs to its machine.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.reporting.measured import ENDS
from experiments.reporting.table import Table, records
from experiments.reporting.text import counted, number

EQUAL, WITHIN, OUTSIDE = "equal", "within its interval", "outside"
SAME = 1e-5  # relative: tables have six digits
MOST = 5  # differences that the terminal names; the page has all
SECONDS = ("_s", "_s_per_frame", "time", "seconds")  # ends of names of columns
RATIO = "training_time_over_hdc"  # until 90 % in training, whatever ends it later
SENTENCES = {
    RATIO: "{who} took {own} times HDC's training time",
    "test_accuracy_final": "{who} has a test accuracy of {own} %",
}
ONE_SEED = "; one seed on a busy machine often differs that much"


@dataclass(frozen=True)
class Cell:
    """A number of one's own and that of the reference.

    Attributes:
        table: one's own.
        index: of the row in the table.
        row: its values by the names of columns.
        column: name of the column.
        own, reference: value, lower and upper bound; a number of one's own without an interval is
            its own bounds.
    """

    table: Table
    index: int
    row: Mapping[str, Any]
    column: str
    own: Sequence[float]
    reference: Sequence[float]

    @property
    def verdict(self) -> str:
        """``equal``, ``within its interval`` or ``outside``."""
        own, lowest, highest = self.own
        reference, low, high = self.reference
        if math.isclose(own, reference, rel_tol=SAME, abs_tol=1e-12):
            return EQUAL
        return WITHIN if lowest <= high and highest >= low else OUTSIDE

    @property
    def bounds(self) -> str:
        """``3.9 to 4.1``: the interval of the reference."""
        return " to ".join(map(self._shown, self.reference[1:]))

    @property
    def who(self) -> str:
        """Cells that distinguish the row from the others of its table."""
        data, key = self.table.data, self.table.key
        telling = [name for name in key if data[name].nunique() > 1]
        names = telling or key
        return ", ".join(self.table.column(name).text(name, self.row) for name in names)

    def __str__(self) -> str:
        """One sentence."""
        column = self.table.column(self.column)
        sentence = SENTENCES.get(self.column, f"{{who}}: {column.head} {{own}}")
        said = sentence.format(who=self.who, own=self._shown(self.own[0]))
        alone = self.column == RATIO and self.row.get("seeds") == 1
        return f"{said} (reference: {self.bounds}){ONE_SEED if alone else ''}."

    def _shown(self, value: float) -> str:
        if self.column == RATIO:
            return number(value, 2)
        return self.table.column(self.column).show(value)


def compare(own: Iterable[Table], reference: Iterable[Table]) -> list[Cell]:
    """The cells that tables of one's own share with those of the reference."""
    known = {table.name: table for table in reference}
    cells: list[Cell] = []
    for table in own:
        if table.key and table.name in known:
            cells += _cells(table, known[table.name])
    return cells


def differing(cells: Iterable[Cell]) -> list[Cell]:
    """The cells whose numbers differ."""
    return [cell for cell in cells if cell.verdict == OUTSIDE]


def summary(cells: Sequence[Cell]) -> str:
    """How many numbers are compared, and what they are."""
    counts = Counter(cell.verdict for cell in cells)
    words = [f"{counts[verdict]} {verdict}" for verdict in (EQUAL, WITHIN, OUTSIDE)]
    return f"{counted(len(cells), 'number')} of yours beside the reference: {', '.join(words)}"


def lines(cells: Sequence[Cell]) -> Iterator[str]:
    """The summary, and the first that differ."""
    yield summary(cells)
    found = differing(cells)
    for cell in found[:MOST]:
        yield f"{cell.table.name}: {cell}"
    if len(found) > MOST:
        yield f"{len(found) - MOST} more on the page"


def _cells(own: Table, reference: Table) -> Iterator[Cell]:
    theirs = {_key(row, own): row for row in records(reference.data)}
    for index, row in enumerate(records(own.data)):
        other = theirs.get(_key(row, own), {})
        for name in row:
            known = _numbers(other, name)
            value = _numbers(row, name, ENDS[:1])
            same = name == RATIO or row.get("stop") == other.get("stop")
            if known and value and same and not name.endswith(SECONDS):
                bounded = _numbers(row, name) or 3 * value
                yield Cell(own, index, row, name, bounded, known)


def _key(row: Mapping[str, Any], table: Table) -> tuple[Any, ...]:
    return tuple(row.get(name) for name in table.key)


def _numbers(
    row: Mapping[str, Any], name: str, ends: Sequence[str] = ENDS
) -> list[float]:
    """The value and the bounds of a column; none unless all are there."""
    found = [row.get(f"{name}{end}") for end in ends]
    numbers = [value for value in found if isinstance(value, int | float)]
    return numbers if len(numbers) == len(ends) else []
