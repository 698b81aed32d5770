"""Own results beside the reference: tables of one name, joined by the key of their rows.

A number differs where its interval, or the number itself if it has none, lies outside the interval
of the reference. Results at the end of training are compared under the same stopping rule only, and
quantities of a machine, such as seconds, are not compared at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pandas as pd

from experiments.reporting.table import ENDS, Table, records
from experiments.reporting.text import counted

SAME = 1e-5  # relative: tables have six digits
MOST = 5  # differences that the terminal names; the page has all
UNTIL_90 = "training_time_over_hdc"  # whatever ends the training later
REFERENCE = "_reference"  # ends the names of the columns of the reference
COLUMNS = ("table", "differs", "sentence")


def compare(own: Iterable[Table], reference: Iterable[Table]) -> pd.DataFrame:
    """A row for each number of one's own that the reference has with an interval, in the row with
    the same key of the table of the same name.

    Returns:
        DataFrame: name of the ``table``, whether the number ``differs``, and a ``sentence``.
    """
    known = {table.name: table for table in reference}
    found = [
        row
        for table in own
        if table.key and table.name in known
        for row in _compared(table, known[table.name])
    ]
    return pd.DataFrame(found, columns=COLUMNS).astype({"differs": bool})


def _compared(own: Table, reference: Table) -> Iterator[tuple[str, bool, str]]:
    """The rows of one table."""
    ours, theirs = (each.data.astype(object) for each in (own, reference))
    names = [
        name
        for name in map(str, ours)
        if f"{name}{ENDS[1]}" in theirs and not own.column(name).of_machine
    ]
    joined = ours.merge(theirs, on=list(own.key), suffixes=("", REFERENCE))
    for line in records(joined):
        same_rule = line.get("stop_rule") == line.get(f"stop_rule{REFERENCE}")
        for name in names:
            value, low, high = (line.get(f"{name}{end}") for end in ENDS)
            bounds = [line.get(f"{name}{end}{REFERENCE}") for end in ENDS]
            if value is None or None in bounds or not (same_rule or name == UNTIL_90):
                continue
            interval = (value, value) if low is None or high is None else (low, high)
            yield own.name, _differs(value, interval, bounds), _told(own, line, name)


def _differs(value: float, ours: Sequence[float], theirs: Sequence[Any]) -> bool:
    """Whether a number is not that of the reference, and its bounds lie outside the others."""
    (low, high), (known, lowest, highest) = ours, theirs
    same = math.isclose(value, known, rel_tol=SAME, abs_tol=1e-12)
    return not same and (low > highest or high < lowest)


def _told(own: Table, line: dict[str, Any], name: str) -> str:
    """The cells that tell the row from others, the number, and the bounds of the reference."""
    telling = [key for key in own.key if own.data[key].nunique() > 1] or own.key
    who = ", ".join(own.column(key).text(key, line) for key in telling)
    show, head = own.column(name).show, own.column(name).head
    bounds = " to ".join(show(line[f"{name}{end}{REFERENCE}"]) for end in ENDS[1:])
    return f"{who}: {head}: {show(line[name])} (reference: {bounds})."


def lines(numbers: pd.DataFrame) -> Iterator[str]:
    """How many numbers are compared, and the first that differ."""
    found = numbers[numbers.differs]
    many = counted(len(numbers), "number")
    yield f"{many} of yours beside the reference: {len(found)} outside its interval"
    for row in found[:MOST].itertuples():
        yield f"{row.table}: {row.sentence}"
    if len(found) > MOST:
        yield f"{len(found) - MOST} more on the page"
