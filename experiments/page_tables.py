"""Tables of the page: from rows of a report, from CSV files, measurements and records."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments import table_text
from experiments.measurement import Measured, read

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)
_BORDER = re.compile(r"(?<!\\) \| ")  # between two cells of Markdown
_ESCAPE = re.compile(r"\\([\\|~<>\[\]_*`])")
_LONG = 25  # rows of a table that is folded away until asked for
_MOST = 200  # rows that are shown at all
# Columns that say how a row was made: told once below the table if all rows agree.
_MADE_BY = ("command", "made_by")


@dataclass(frozen=True)
class Cell:
    """What is shown, and the value it was rounded from where it was."""

    text: str
    exact: str = ""


@dataclass(frozen=True)
class Table:
    """A table, or what is said in its place.

    Attributes:
        name: of the file it is from, unique on the page; an anchor.
        title, intro, notes: plain text around it.
        columns: heads.
        rows: one tuple of cells a row.
        commands: what makes it again.
        instead: what is said in place of rows.
    """

    name: str
    title: str
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[Cell]] = ()
    intro: str = ""
    notes: str = ""
    commands: Sequence[str] = ()
    instead: str = ""

    @property
    def kinds(self) -> list[str]:
        """Of each column: number, code, long text or text."""
        return [_kind([cell.text for cell in column if cell.text not in ("", "–")])
                for column in zip(*self.rows, strict=True)]  # fmt: skip

    @property
    def folded(self) -> bool:
        return len(self.rows) > _LONG


def _kind(texts: Sequence[str]) -> str:
    if texts and all(map(_NUMBER.match, texts)):
        return "number"
    if any(text.startswith("python ") for text in texts):
        return "code"
    return "long" if any(len(text) > 30 for text in texts) else "text"


def missing(name: str, title: str, what: str, command: str, intro: str = "") -> Table:
    """A table that says what has not been made, and how it is."""
    text = f"missing: {what} has not been made"
    return Table(name, title, intro=intro, commands=[command], instead=text)


def of_markdown(name: str, title: str, text: str, command: str, how: str = "") -> list[Table]:
    """The tables of a Markdown text as the report writes them, with what stands around each.

    Args:
        name: of the first table; the others have a number behind it.
        title: of the first table, unless it has a bold line of its own as the others have.
        text: paragraphs and tables, with an empty line after each.
        command: what makes the tables again.
        how: said below the last.
    """
    blocks = [block.strip() for block in text.split("\n\n") if block.strip()]
    found: list[Table] = []
    before: list[str] = []
    for block in blocks:
        if block.startswith("| "):
            head, _, *rows = ([_plain(c) for c in _BORDER.split(line[2:-2])]
                              for line in block.splitlines())  # fmt: skip
            place = f"{name}-{len(found) + 1}" if found else name
            # The text may begin with a summary; the bold line right before a table is its title.
            heading = before.pop() if before and (found or len(before) > 1) else title
            intro = "\n".join(line for line in before if line != heading)
            cells = [[Cell(cell) for cell in row] for row in rows]
            instead = "" if rows else "missing: nothing has been measured"
            found.append(Table(place, heading, head, cells, intro, instead=instead))
            before = []
        elif found and not block.startswith("**"):
            found[-1] = replace(found[-1], notes=f"{found[-1].notes}\n{_plain(block)}".strip())
        else:
            before.append(_plain(block))
    found = found or [Table(name, title, intro="\n".join(before))]
    found[-1] = replace(found[-1], commands=[command], notes=f"{found[-1].notes}\n{how}".strip())
    return found


def _plain(text: str) -> str:
    """Markdown without its marks."""
    return _ESCAPE.sub(r"\1", text.strip().strip("`").replace("**", "").replace(" `", " "))


def of_csv(path: Path, title: str, command: str, intro: str = "", name: str = "") -> Table:
    """A CSV file, numbers rounded to four digits; missing if it is not there."""
    name = name or path.stem
    if not path.is_file():
        return missing(name, title, f"{path.parent.name}/{path.name}", command, intro)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if line[:1] != "#"))
    return of_dicts(name, title, rows, [command], intro)


def of_measurement(
    results: Path, name: str, title: str, command: str, intro: str = ""
) -> list[Table]:
    """A measurement, as its Markdown file or by its rows; missing if there is none."""
    try:
        measured = read(results, name)
    except ValueError as error:
        return [Table(name, title, intro=intro, commands=[command], instead=str(error))]
    if measured is None:
        return [missing(name, title, f"measured/{name}", command, intro)]
    command = measured.record.get("command", command)
    path = results / "tables" / f"{name}.md"
    if path.is_file():
        return of_markdown(name, title, path.read_text("utf-8"), command, _how(measured))
    return [of_dicts(name, title, measured.rows, [command], intro, _how(measured))]


def of_machines(entries: Iterable[Mapping[str, Any]]) -> Table:
    """On what machines, and by what code, records and measurements were made: a column each."""
    count: Counter[tuple[tuple[str, str], ...]] = Counter()
    commits: dict[tuple[tuple[str, str], ...], set[str]] = {}
    for entry in entries:
        made = entry.get("environment", {})
        packages = made.get("packages") or {}
        machine = {
            **{key: str(made.get(key, "–"))
               for key in ("cpu", "cores", "threads", "device", "platform", "python")},
            **{key: str(value or "–") for key, value in sorted(packages.items())},
        }  # fmt: skip
        key = tuple(machine.items())
        count[key] += 1
        dirty = " with changes" if made.get("dirty") else ""
        commits.setdefault(key, set()).add(f"{(made.get('commit') or '–')[:8]}{dirty}")
    if not count:
        return Table("environment", "Environment", instead="missing: no records")
    found = [key for key, _ in count.most_common()]
    heads = list(dict.fromkeys(name for key in found for name, _ in key))
    rows = [[Cell("records"), *(Cell(str(count[key])) for key in found)]]
    rows += [[Cell(head), *(Cell(dict(key).get(head, "–")) for key in found)] for head in heads]
    rows.append([Cell("commits"), *(Cell(", ".join(sorted(commits[key]))) for key in found)])
    names = [f"machine {k + 1}" for k in range(len(found))]
    return Table("environment", "Environment", ["", *names], rows)


def of_dicts(
    name: str,
    title: str,
    rows: Sequence[Mapping[str, str]],
    commands: Sequence[str],
    intro: str = "",
    notes: str = "",
) -> Table:
    columns = list(dict.fromkeys(key for row in rows for key in row))
    for key in _MADE_BY:
        told = {row.get(key) for row in rows}
        if key in columns and len(told) == 1:
            columns.remove(key)
            commands = [*filter(None, told)] or commands
    if len(rows) > _MOST:
        text = f"{len(rows):,} rows, too many to show: they are drawn as figures"
        return Table(name, title, (), (), intro, notes, commands, text)
    return Table(
        name,
        title,
        [column.replace("_", " ") for column in columns],
        [[rounded(row.get(column) or "–") for column in columns] for row in rows],
        intro,
        notes,
        commands,
        "" if rows else "it has no rows",
    )


def rounded(text: str) -> Cell:
    """A number to four significant digits with the exact one beside it; any other text as it is."""
    if not _NUMBER.fullmatch(text):
        return Cell(text)
    short = f"{float(text):.4g}"
    return Cell(text) if len(short) >= len(text) else Cell(short, text)


def _how(measured: Measured) -> str:
    entry = measured.record
    parts = []
    if entry["status"] != "finished":
        parts.append(f"{entry['status']}: {entry.get('error', 'not finished')}")
    if entry.get("seconds"):
        parts.append(f"made in {table_text.number(entry['seconds'])} s")
    if entry.get("peak_bytes"):
        parts.append(f"peak memory {table_text.bytes_cell(entry['peak_bytes'])}")
    if changed := measured.outdated:
        parts.append(f"by other code than this ({', '.join(changed)} changed since)")
    return "; ".join(parts)
