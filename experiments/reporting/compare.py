"""Own results beside the reference: numbers of tables of one name, joined by the key of their rows.

A number differs where its interval, or the number itself if it has none, lies outside the interval
of the reference. Results at the end of training are compared under the same stopping rule only, and
quantities of a machine, such as seconds, are not compared at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
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
        (table.name, _differs(line), _told(table, name, line))
        for table in own
        if table.key and table.name in known
        for name, line in _numbers(table, known[table.name])
    ]
    return pd.DataFrame(found, columns=COLUMNS).astype({"differs": bool})


def _numbers(own: Table, reference: Table) -> Iterator[tuple[str, dict[str, Any]]]:
    """The name of each number that both tables have, and its line: the key, and the number with its
    bounds as ``value``, with a suffix for the reference."""
    ours, theirs = (table.data.astype(object) for table in (own, reference))
    joined = ours.merge(theirs, on=list(own.key), suffixes=("", REFERENCE))
    rules = joined.reindex(columns=["stop_rule", f"stop_rule{REFERENCE}"])
    same_rule = rules.nunique(axis="columns") < 2
    for name in map(str, ours):
        if f"{name}{ENDS[1]}" not in theirs or own.column(name).of_machine:
            continue
        named = {
            f"{name}{end}{of}": f"value{end}{of}"
            for end in ENDS
            for of in ("", REFERENCE)
        }
        lines = joined.reindex(columns=[*own.key, *named]).rename(columns=named)
        asked = ["value", *(f"value{end}{REFERENCE}" for end in ENDS)]
        lines = lines[same_rule | (name == UNTIL_90)].dropna(subset=asked)
        yield from ((name, line) for line in records(lines))


def _differs(line: dict[str, Any]) -> bool:
    """Whether a number is not that of the reference, and its bounds lie outside the others."""
    value, low, high = (line[f"value{end}"] for end in ENDS)
    known, lowest, highest = (line[f"value{end}{REFERENCE}"] for end in ENDS)
    if low is None or high is None:
        low = high = value
    same = math.isclose(value, known, rel_tol=SAME, abs_tol=1e-12)
    return not same and (low > highest or high < lowest)


def _told(own: Table, name: str, line: dict[str, Any]) -> str:
    """The cells that tell the row from others, the number, and the bounds of the reference."""
    telling = [key for key in own.key if own.data[key].nunique() > 1] or own.key
    who = ", ".join(own.column(key).text(key, line) for key in telling)
    show, head = own.column(name).show, own.column(name).head
    bounds = " to ".join(show(line[f"value{end}{REFERENCE}"]) for end in ENDS[1:])
    return f"{who}: {head}: {show(line['value'])} (reference: {bounds})."


def lines(numbers: pd.DataFrame) -> Iterator[str]:
    """How many numbers are compared, and the first that differ."""
    found = numbers[numbers.differs]
    many = counted(len(numbers), "number")
    yield f"{many} of yours beside the reference: {len(found)} outside its interval"
    for row in found[:MOST].itertuples():
        yield f"{row.table}: {row.sentence}"
    if len(found) > MOST:
        yield f"{len(found) - MOST} more on the page"
