"""Own results beside the reference: tables of one name, joined by the key of their rows.

A number differs where its interval, or the number itself if it has none, lies outside the interval
of the reference. What a training ends with is compared under one stopping rule alone, and what
belongs to a machine, as seconds do, is not compared at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pandas as pd

from experiments.reporting.table import ENDS, Table, records
from experiments.reporting.text import counted, number

EQUAL, WITHIN, OUTSIDE = "equal", "within its interval", "outside"
SAME = 1e-5  # relative: tables have six digits
MOST = 5  # differences that the terminal names; the page has all
UNTIL_90 = "training_time_over_hdc"  # whatever ends the training later
REFERENCE = "_reference"  # ends the names of the columns of the reference
COLUMNS = ("table", "row", "column", "verdict", "bounds", "sentence")
ONE_SEED = "; one seed on a busy machine often differs that much"


def joined(own: Table, reference: Table) -> pd.DataFrame:
    """The rows of one's own table, each beside that of the reference with the same key."""
    ours, theirs = (each.data.astype(object) for each in (own, reference))
    key = list(own.key)
    return ours.merge(theirs, "left", key, suffixes=("", REFERENCE))


def compare(own: Table, reference: Table) -> pd.DataFrame:
    """A row for each number of one's own that the reference has with an interval.

    Returns:
        DataFrame: name of the ``table``, number of the ``row`` in it, name of the ``column``,
        ``verdict``, ``bounds`` of the reference and a ``sentence``.
    """
    found: list[dict[str, Any]] = []
    if own.key:
        names = [str(name) for name in own.data if f"{name}{ENDS[1]}" in reference.data]
        names = [name for name in names if not own.column(name).of_machine]
        for row, line in enumerate(records(joined(own, reference))):
            for name in names:
                if _is_comparable(line, name):
                    found += _compared(own, row, line, name)
    return pd.DataFrame(found, columns=COLUMNS)


def _is_comparable(line: dict[str, Any], name: str) -> bool:
    rule = line.get("stop_rule")
    return name == UNTIL_90 or rule == line.get(f"stop_rule{REFERENCE}")


def _compared(
    own: Table, row: int, line: dict[str, Any], name: str
) -> Iterator[dict[str, Any]]:
    """A number and its verdict, if both sides have it."""
    value = line.get(name)
    ours: list[Any] = [line.get(f"{name}{end}") for end in ENDS[1:]]
    theirs: list[Any] = [line.get(f"{name}{end}{REFERENCE}") for end in ENDS]
    if value is None or None in theirs:
        return
    if None in ours:
        ours = [value, value]
    show = _two if name == UNTIL_90 else own.column(name).show
    bounds = " to ".join(map(show, theirs[1:]))
    sentence = f"{_who(own, line)}: {own.column(name).head}: {show(value)} (reference: {bounds})"
    if name == UNTIL_90 and line.get("seeds") == 1:
        sentence += ONE_SEED
    values = (
        own.name,
        row,
        name,
        _verdict(value, ours, theirs),
        bounds,
        f"{sentence}.",
    )
    yield dict(zip(COLUMNS, values, strict=True))


def _two(value: float) -> str:
    return number(value, 2)


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
    return (
        pd.concat(filled, ignore_index=True)
        if filled
        else pd.DataFrame(columns=COLUMNS)
    )


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
