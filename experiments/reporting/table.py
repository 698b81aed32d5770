"""A table: how it follows from records, its values, and its cells in CSV, Markdown and LaTeX."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from experiments.records import configs
from experiments.records.console import printable
from experiments.records.results import OF_TRAININGS
from experiments.reporting.columns import COLUMNS, Column, display_name
from experiments.reporting.text import (
    TEX,
    counted,
    frames_of,
    markdown_table,
    markdown_text,
    one_line,
    percent,
)

RUN = "python -m experiments.run experiment="
MOST_COLUMNS = 8  # that are shown; a page has no room for more
ENDS = ("", "_low", "_high")  # of the columns of a value and its bounds
# A dash, or a number and what follows it: a unit, or bounds.
_NUMBER = re.compile(r"–?|[-+−±×> ]*\d.*", re.DOTALL)
Text = str | Callable[[pd.DataFrame], str]  # a text, or what gives it from the values


@dataclass(frozen=True)
class Table:
    """Values and how they are shown.

    Attributes:
        name: stem of its files, and its anchor on the page.
        make: from the tidy frame of the experiments to the values, a data frame; no rows, or None,
            where there are none.
        of: the experiments whose lines it takes; ``runs`` stands for single trainings.
        key: names of the columns that tell its rows apart, by which own results are compared with
            the reference; nothing is compared without.
        title, note: what it shows, and how to read it; may hold ``{frames}`` and ``{machine}``.
        columns: how columns are shown, before :data:`COLUMNS`.
        shown: names of the columns that are shown, in their order; all but bounds, if empty.
        commands: make it again; if empty, the commands of its experiments.
        data: the values, as the CSV has them.
    """

    name: str
    make: Callable[[pd.DataFrame], pd.DataFrame | None]
    of: str | Sequence[str]
    key: Sequence[str] = ()
    title: Text = ""
    note: Text = ""
    columns: Mapping[str, Column] = field(default_factory=dict)
    shown: Sequence[str] = ()
    commands: Sequence[str] = ()
    data: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def experiments(self) -> tuple[str, ...]:
        """Names of the experiments whose lines it takes."""
        return (self.of,) if isinstance(self.of, str) else tuple(self.of)

    def made(self, frame: pd.DataFrame) -> Table | None:
        """The table with the values that follow from the frame of its experiments, if any do."""
        data = self.make(frame) if len(frame) else None
        if data is None or not len(data):
            return None
        own = [f"{RUN}{name}" for name in self.experiments if name not in OF_TRAININGS]
        return replace(
            self,
            data=data.reset_index(drop=True),
            title=_filled(self.title, data, frame),
            note=_filled(self.note, data, frame),
            commands=self.commands or own,
        )

    @property
    def names(self) -> list[str]:
        """Names of the columns that are shown; the CSV has all of them."""
        every = map(str, self.shown or self.data.columns)
        values = [name for name in every if not name.endswith(ENDS[1:])]
        return values[:MOST_COLUMNS]

    def column(self, name: str) -> Column:
        """How a column is shown; one named after a model has shares of right samples."""
        known = self.columns.get(name) or COLUMNS.get(name)
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
        columns = {name: self.column(name) for name in self.names}
        rows = records(self.data)
        return [[c.text(name, row) for name, c in columns.items()] for row in rows]

    def numeric(self) -> list[bool]:
        """Whether each shown column holds numbers, which stand right."""
        columns = zip(*self.cells(), strict=True)
        return [all(map(_NUMBER.fullmatch, texts)) for texts in columns]

    @property
    def notes(self) -> str:
        """The notes of its columns, then its own."""
        of_columns = dict.fromkeys(self.column(name).note for name in self.names)
        return " ".join(filter(None, [*of_columns, str(self.note)]))

    def csv(self) -> str:
        """Comma-separated values; a missing value is empty, numbers have six digits."""
        return self.data.map(_exact).to_csv(index=False, lineterminator="\n")

    def tex(self) -> str:
        """The table as LaTeX, by pandas; it needs the package ``booktabs``."""
        shown = pd.DataFrame(self.cells(), columns=self.heads).map(one_line)
        sides = "".join("r" if numbers else "l" for numbers in self.numeric())
        text = shown.to_latex(index=False, escape=True, column_format=sides)
        return text.translate(TEX)

    def rows(self) -> str:
        """Heads and cells in Markdown."""
        rows = ([_lines(cell) for cell in row] for row in self.cells())
        return markdown_table(self.heads, *rows)


def text_for(text: Text, data: pd.DataFrame) -> str:
    """A text as it is, or as a function of the values gives it."""
    return text(data) if callable(text) else text


def _filled(text: Text, data: pd.DataFrame, frame: pd.DataFrame) -> str:
    """A text with the frames and the machine put in of the lines that the values follow from."""
    filled = text_for(text, data)
    if "{frames}" in filled:
        filled = filled.replace("{frames}", frames_of(frame.origin.dropna()))
    if "{machine}" in filled:
        filled = filled.replace("{machine}", _machine(frame.iloc[0]))
    return filled


def _machine(line: pd.Series) -> str:
    parts = [str(line.cpu), counted(int(line.threads), "thread")]
    if line.device not in (None, "cpu"):
        parts.insert(0, str(line.device))
    return ", ".join(parts)


def frame(
    rows: Iterable[Mapping[str, Any]], columns: Sequence[str] = ()
) -> pd.DataFrame:
    """Rows as a data frame of objects, so that integers and texts stay what they are. It has the
    named columns, or all columns of the rows."""
    names = list(columns) or None
    return pd.DataFrame(list(rows), columns=names, dtype=object)


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
