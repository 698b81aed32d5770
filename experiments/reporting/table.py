"""A table: how it follows from results, its values, and its cells in CSV, Markdown and LaTeX."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from experiments.records import configs
from experiments.reporting.columns import COLUMNS, Column, display_name
from experiments.reporting.text import (
    counted,
    frames_of,
    markdown_text,
    percent,
    printable,
    tex_text,
)

MOST_COLUMNS = 8  # that are shown; a page has no room for more
Of = str | Sequence[str]  # one experiment, or several; "runs" for single trainings
Text = Any  # a str, or a function of the frame that gives one
Columns = Mapping[str, Column] | Callable[[pd.DataFrame], Mapping[str, Column]]
Names = Sequence[str] | Callable[[pd.DataFrame], Sequence[str]]


@dataclass(frozen=True)
class Table:
    """Values and how they are shown.

    Attributes:
        name: stem of its files, and its anchor on the page.
        make: from the frame of the experiments to the values; None where there are none.
        of: the experiments whose lines it takes.
        title, note: what it shows, and how to read it; may hold ``{frames}`` and ``{machine}``.
        columns: how columns are shown, before :data:`COLUMNS`; or a function of the values.
        shown: names of the columns that are shown, in their order; or a function of the values;
            all but bounds, if empty.
        key: names of the columns that tell its rows apart, by which own results are compared with
            the reference; nothing is compared without.
        commands: what makes it again; those of the records if there are none here.
        data: the values, as the CSV has them.
    """

    name: str
    make: Callable[[pd.DataFrame], pd.DataFrame | None] | None = None
    of: Of = ()
    title: Text = ""
    note: Text = ""
    columns: Columns = field(default_factory=dict)
    shown: Names = ()
    key: Sequence[str] = ()
    commands: Sequence[str] = ()
    data: pd.DataFrame = field(default_factory=pd.DataFrame)

    def made(self, frame: pd.DataFrame) -> Iterator[Table]:
        """The table with the values that follow from the frame of its experiments, if any do."""
        data = self.make(frame) if self.make else None
        if data is None or not len(data):
            return
        yield replace(
            self,
            data=data,
            title=text_of(self.title, frame),
            note=text_of(self.note, frame),
            commands=commands_of(self.commands, frame),
        )

    @property
    def names(self) -> list[str]:
        """Names of the columns that are shown; the CSV has all of them."""
        shown = self.shown(self.data) if callable(self.shown) else self.shown
        every = map(str, shown or self.data.columns)
        values = [name for name in every if not name.endswith(("_low", "_high"))]
        return values[:MOST_COLUMNS]

    def column(self, name: str) -> Column:
        """How a column is shown; one named after a model has shares of right samples."""
        columns = self.columns(self.data) if callable(self.columns) else self.columns
        known = columns.get(name) or COLUMNS.get(name)
        if known:
            return known
        if configs.is_known("model", name):
            return Column(display_name(name), percent)
        return Column(name[:1].upper() + name[1:].replace("_", " "))

    @property
    def heads(self) -> list[str]:
        """Heads of the columns as shown."""
        return [self.column(name).head for name in self.names]

    def cells(self) -> list[list[str]]:
        """Texts, a list a row."""
        names = self.names
        columns = [self.column(name) for name in names]
        rows = []
        for row in records(self.data):
            texts = map(Column.text, columns, names, itertools.repeat(row))
            rows.append(list(texts))
        return rows

    @property
    def notes(self) -> str:
        """The note, after those of its columns."""
        of_columns = dict.fromkeys(self.column(name).note for name in self.names)
        return " ".join(filter(None, [*of_columns, self.note]))

    def csv(self) -> str:
        """Comma-separated values; a missing value is empty, numbers have six digits."""
        shown = self.data.map(_exact) if len(self.data) else self.data
        return shown.to_csv(index=False, lineterminator="\n")

    def tex(self) -> str:
        """The table as LaTeX, by pandas; it needs the package ``booktabs``."""
        shown = pd.DataFrame(self.cells(), columns=self.heads)
        escaped = shown.map(tex_text)
        escaped.columns = [tex_text(head) for head in self.heads]
        return escaped.to_latex(
            index=False,
            escape=False,
            caption=tex_text(self.title),
            label=f"tab:{self.name}",
        )

    def markdown(self) -> str:
        """The table with its title above and its note below."""
        heads = self.heads
        lines = [heads, ["---"] * len(heads)]
        lines += [list(map(_lines, row)) for row in self.cells()]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        parts = [
            f"**{markdown_text(self.title)}**",
            table,
            markdown_text(self.notes),
        ]
        return "\n\n".join(filter(None, parts)) + "\n"


def experiments_of(of: Of) -> tuple[str, ...]:
    """Names of experiments."""
    return (of,) if isinstance(of, str) else tuple(of)


def text_of(text: Text, frame: pd.DataFrame) -> str:
    """A text with the frames and the machine of the records put in."""
    filled = str(text(frame) if callable(text) else text)
    if "{frames}" in filled:
        filled = filled.replace("{frames}", frames_of(frame.to_dict("records")))
    if "{machine}" in filled:
        filled = filled.replace("{machine}", _machine(frame.iloc[0]))
    return filled


def _machine(line: pd.Series) -> str:
    parts = [str(line.cpu), counted(int(line.threads), "thread")]
    if line.device not in (None, "cpu"):
        parts.insert(0, str(line.device))
    return ", ".join(parts)


def commands_of(given: Sequence[str], frame: pd.DataFrame) -> tuple[str, ...]:
    """Those given, else those that made the records, each once."""
    return tuple(given) or tuple(dict.fromkeys(frame.command))


def frame(
    rows: Iterable[Mapping[str, Any]], columns: Sequence[str] = ()
) -> pd.DataFrame:
    """Rows as a data frame of objects: integers and texts stay what they are. Its columns are those
    named, else those of the rows."""
    rows = list(rows)
    names = list(columns) or list(dict.fromkeys(itertools.chain(*rows)))
    cells: dict[str, list[Any]] = {}
    for name in names:
        cells[name] = [row.get(name) for row in rows]
    return pd.DataFrame(cells, columns=names, dtype=object)


def records(data: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a data frame as mappings; a missing value is None."""
    return data.astype(object).where(data.notna(), None).to_dict("records")


def _lines(cell: str) -> str:
    return "<br>".join(map(markdown_text, cell.split("\n")))


def _exact(value: Any) -> str:
    if value is None or value is pd.NA or value != value:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(str(value))
