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
from experiments.reporting.text import counted, two_digits

EQUAL, WITHIN, OUTSIDE = "equal", "within its interval", "outside"
SAME = 1e-5  # relative: tables have six digits
MOST = 5  # differences that the terminal names; the page has all
UNTIL_90 = "training_time_over_hdc"  # whatever ends the training later
REFERENCE = "_reference"  # ends the names of the columns of the reference
COLUMNS = ("table", "row", "column", "verdict", "bounds", "sentence")
ONE_SEED = "; one seed on a busy machine often differs that much"


def compare(own: Table, reference: Table) -> pd.DataFrame:
    """A row for each number of one's own that the reference has with an interval, in the row with
    the same key.

    Returns:
        DataFrame: name of the ``table``, number of the ``row`` in it, name of the ``column``,
        ``verdict``, ``bounds`` of the reference and a ``sentence``.
    """
    ours, theirs = (each.data.astype(object) for each in (own, reference))
    names = [
        name
        for name in map(str, ours)
        if f"{name}{ENDS[1]}" in theirs and not own.column(name).of_machine
    ]
    found: list[dict[str, Any]] = []
    if own.key:
        joined = ours.merge(theirs, "left", list(own.key), suffixes=("", REFERENCE))
        for row, line in enumerate(records(joined)):
            same_rule = line.get("stop_rule") == line.get(f"stop_rule{REFERENCE}")
            for name in names:
                if same_rule or name == UNTIL_90:
                    place = {"table": own.name, "row": row, "column": name}
                    found += (place | told for told in _compared(own, line, name))
    return pd.DataFrame(found, columns=COLUMNS)


def _compared(own: Table, line: dict[str, Any], name: str) -> Iterator[dict[str, str]]:
    """A number, if both sides have it: its verdict, bounds and sentence."""
    value, *ours = (line.get(f"{name}{end}") for end in ENDS)
    theirs: list[Any] = [line.get(f"{name}{end}{REFERENCE}") for end in ENDS]
    if value is None or None in theirs:
        return
    show = two_digits if name == UNTIL_90 else own.column(name).show
    bounds = " to ".join(map(show, theirs[1:]))
    text = f"{own.column(name).head}: {show(value)} (reference: {bounds})"
    if name == UNTIL_90 and line.get("seeds") == 1:
        text += ONE_SEED
    bounded: list[Any] = [value, value] if None in ours else ours
    yield {
        "verdict": _verdict(value, bounded, theirs),
        "bounds": bounds,
        "sentence": f"{_who(own, line)}: {text}.",
    }


def _verdict(value: float, ours: Sequence[float], theirs: Sequence[float]) -> str:
    """Whether a number with its bounds is that of the reference, or overlaps its interval."""
    known, lowest, highest = theirs
    if math.isclose(value, known, rel_tol=SAME, abs_tol=1e-12):
        return EQUAL
    low, high = ours
    return WITHIN if low <= highest and high >= lowest else OUTSIDE


def _who(own: Table, line: dict[str, Any]) -> str:
    """Cells that tell the row from the others of its table."""
    telling = [name for name in own.key if own.data[name].nunique() > 1] or own.key
    return ", ".join(own.column(name).text(name, line) for name in telling)


def compare_all(own: Iterable[Table], reference: Iterable[Table]) -> pd.DataFrame:
    """The numbers of all tables that both sides have."""
    known = {table.name: table for table in reference}
    parts = [compare(table, known[table.name]) for table in own if table.name in known]
    filled = [part for part in parts if len(part)]
    if not filled:
        return pd.DataFrame(columns=COLUMNS)
    return pd.concat(filled, ignore_index=True)


def differing(numbers: pd.DataFrame) -> pd.DataFrame:
    """Those that differ."""
    return numbers[numbers.verdict == OUTSIDE]


def lines(numbers: pd.DataFrame) -> Iterator[str]:
    """How many numbers are compared, what they are, and the first that differ."""
    counts = numbers.verdict.value_counts()
    words = [
        f"{counts.get(verdict, 0)} {verdict}" for verdict in (EQUAL, WITHIN, OUTSIDE)
    ]
    many = counted(len(numbers), "number")
    yield f"{many} of yours beside the reference: {', '.join(words)}"
    found = differing(numbers)
    for row in found[:MOST].itertuples():
        yield f"{row.table}: {row.sentence}"
    if len(found) > MOST:
        yield f"{len(found) - MOST} more on the page"
