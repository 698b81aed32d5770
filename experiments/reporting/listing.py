"""A list of the tables, a line each, and which of them rest on records of older revisions."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping

from experiments.records.results import Results
from experiments.reporting.table import Table
from experiments.reporting.text import markdown_text

README = "tables/README.md"
_MADE_BY = ("command", "made_by")  # columns with what makes a row again


def readme(tables: Iterable[Table], older: Iterable[str]) -> str:
    """The tables of a folder in Markdown, a line each: file, title, whether of older code."""
    old = set(older)
    lines = []
    for table in sorted(tables, key=lambda table: table.name):
        line = f"- [{table.name}.csv]({table.name}.csv): {markdown_text(table.title)}"
        if table.name in old:
            line += " *(with records of an older revision)*"
        lines.append(line)
    head = (
        "# Tables\n\n"
        "Every table as CSV, which has all columns, and as Markdown, as the page shows it; made by "
        "`python -m experiments.report`.\n"
    )
    return "\n".join([head, *lines]) + "\n"


def older_tables(tables: Iterable[Table], results: Results) -> list[str]:
    """Names of the tables that rest on records of older revisions, by the commands that make their
    rows again."""
    scenes = _older_scenes(results)
    found = []
    for table in tables:
        made_by = (_experiment(command) for command in _commands(table))
        if any(_is_older(name, places, scenes) for name, places in made_by):
            found.append(table.name)
    return sorted(set(found))


def _older_scenes(results: Results) -> dict[str, set[str]]:
    """Experiments with records of older revisions, each with the scenes of these."""
    scenes: dict[str, set[str]] = {}
    for run in results.runs:
        if run.outdated:
            experiment = run.record.experiment or ""
            scenes.setdefault(experiment, set()).add(run.record.scene.name)
    for measured in results.measurements:
        if measured.outdated:
            scenes.setdefault(measured.name, set()).add(measured.scene)
    return scenes


def _is_older(experiment: str, places: set[str], older: Mapping[str, set[str]]) -> bool:
    """Whether an experiment has older records, on one of these scenes if any are named."""
    there = older.get(experiment, set())
    return bool(there & places) if places else bool(there)


def _commands(table: Table) -> Iterator[str]:
    yield from table.commands
    for column in _MADE_BY:
        if column in table.data:
            yield from table.data[column].dropna().unique()


def _experiment(command: str) -> tuple[str, set[str]]:
    """The experiment of a command, and the scenes that it names."""
    words = dict(word.split("=", 1) for word in shlex.split(command) if "=" in word)
    scenes = {scene for scene in words.get("scene", "").split(",") if scene}
    return words.get("experiment", ""), scenes
