"""A list of the tables, a line each, and which of them rest on records of older code."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from experiments.records.results import RUNS, Results
from experiments.reporting.table import Table, experiments_of
from experiments.reporting.text import markdown_text

README = "tables/README.md"
_HEAD = """# Tables

Every table as CSV, which has all columns, and as Markdown, as the page shows it; made by \
`python -m experiments.report`.

"""


def readme(tables: Iterable[Table], older: Collection[str]) -> str:
    """The tables of a folder in Markdown, a line each: file, title, whether of older code."""
    lines = []
    for table in sorted(tables, key=lambda table: table.name):
        line = f"- [{table.name}.csv]({table.name}.csv): {markdown_text(table.title)}"
        if table.name in older:
            line += " *(with records of an older revision)*"
        lines.append(f"{line}\n")
    return _HEAD + "".join(lines)


def older_tables(tables: Iterable[Table], results: Results) -> list[str]:
    """Names of the tables that take an experiment with records of older code."""
    older = {measured.name for measured in results.measurements if measured.outdated}
    if any(run.outdated for run in results.runs):
        older.add(RUNS)
    found = (t.name for t in tables if not older.isdisjoint(experiments_of(t.of)))
    return sorted(found)
