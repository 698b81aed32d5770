"""One claim of the paper: its rule, own numbers beside those of the reference, and the verdict."""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table as TerminalTable
from rich.text import Text

from experiments.records.files import REFERENCE
from experiments.records.results import Results
from experiments.reporting.measured import ENDS
from experiments.reporting.table import Table, records
from experiments.reporting.text import printable
from experiments.studies.claims import frozen, rules, view

# Columns with a word of the rules, of which the first counts.
WORDS = ("word", "verdict")


def show(name: str, own: Path, console: Console) -> None:
    """Print what a claim says, its rule, and every number of it, mine beside the reference's.

    Only what is in own results has a row: a number that was not measured here has none.

    Args:
        name: of the claim.
        own: folder of own results.
        console: where to print.
    """
    for line in rule_lines(name):
        console.print(Text(printable(line)), soft_wrap=True)
    mine, reference = (dict(_tables(folder)) for folder in (own, REFERENCE))
    shown = 0
    for table in mine.values():
        rows = _rows_of(name, table)
        if rows:
            other = reference.get(table.name)
            console.print(_beside(table, rows, other, name))
            shown += 1
    if not shown:
        text = f"{name}: own results hold no evidence of it yet"
        console.print(text, style="yellow", markup=False)
        return
    missing = _missing(name, mine, reference)
    if missing:
        text = f"not measured here, in the reference: {', '.join(missing)}"
        console.print(Text(printable(text), "dim"), soft_wrap=True)
    console.print("tables, figures and the page: python -m experiments.report")


def rule_lines(name: str) -> Iterator[str]:
    """The statement of the paper, or ours, the rule as data, and the rule in words."""
    claim = frozen.claim_as_written(name)
    said = claim.pop("paper", None)
    if said is None:
        yield f"{name}: ours: {claim.pop('ours')}"
    else:
        yield f"{name}: the paper says: {said}"
    rule = str(claim.pop("rule"))
    settings = ", ".join(f"{key} {_plain(value)}" for key, value in claim.items())
    yield f"rule {rule} (version {frozen.rules().version}): {settings}"
    function = getattr(rules, rule, None)
    words = (inspect.getdoc(function) or "").partition("\n\nArgs:")[0]
    if words:
        yield " ".join(words.split())


def _plain(value: Any) -> str:
    """A value of the rules as one would write it."""
    if isinstance(value, Mapping):
        return "; ".join(f"{key} {_plain(each)}" for key, each in value.items())
    if isinstance(value, list):
        return " and ".join(map(_plain, value))
    return str(value)


def _tables(folder: Path) -> Iterator[tuple[str, Table]]:
    """The tables of a results folder, by name, that have a word on claims."""
    for table in view.STUDY.tables_of(Results(folder), []):
        if "claim" in table.data and not set(WORDS).isdisjoint(table.data):
            yield table.name, table


def _rows_of(name: str, table: Table) -> list[dict[str, Any]]:
    return [row for row in records(table.data) if row["claim"] == name]


def _key(row: Mapping[str, Any], table: Table) -> tuple[Any, ...]:
    return tuple(row.get(column) for column in table.key or ("claim",))


def _beside(
    table: Table,
    rows: Sequence[Mapping[str, Any]],
    other: Table | None,
    name: str,
) -> TerminalTable:
    """The rows of a claim in a table: what tells them apart, then each number twice."""
    theirs = {_key(row, other): row for row in _rows_of(name, other)} if other else {}
    keys = [column for column in table.key if column != "claim"]
    values = _values(table)
    shown = TerminalTable(title=printable(table.title), box=box.SIMPLE_HEAD)
    for column in keys:
        shown.add_column(table.column(column).head)
    for column, whose in itertools.product(values, ("mine", "reference")):
        shown.add_column(f"{table.column(column).head}\n{whose}", justify="right")
    for row in rows:
        pair = (row, theirs.get(_key(row, table), {}))
        cells = [_text(table, column, row) for column in keys]
        for column in values:
            cells += [_text(table, column, each) for each in pair]
        shown.add_row(*(Text(printable(cell)) for cell in cells))
    return shown


def _values(table: Table) -> list[str]:
    """The columns of a table that have bounds, and those with a word."""
    names = list(map(str, table.data))
    bounded = [name for name in names if f"{name}{ENDS[1]}" in names]
    words = [name for name in WORDS if name in names]
    return [*bounded, *words[:1]]


def _text(table: Table, column: str, row: Mapping[str, Any]) -> str:
    """A cell; a dash where the row has nothing."""
    if row.get(column) is None:
        return "–"
    return table.column(column).text(column, row)


def _missing(
    name: str,
    mine: Mapping[str, Table],
    reference: Mapping[str, Table],
) -> list[str]:
    """Rows of the reference that own results do not have, by what tells them apart."""
    found = []
    for table in reference.values():
        if not table.key:
            continue
        own = mine.get(table.name)
        known = {_key(row, own) for row in _rows_of(name, own)} if own else set()
        for row in _rows_of(name, table):
            if _key(row, table) not in known:
                words = (row.get(column) for column in table.key if column != "claim")
                found.append(" ".join(str(word) for word in words if word))
    return list(dict.fromkeys(found))
