"""A table: a data frame of values, and its cells in CSV and Markdown."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from experiments.records.configs import CONFIGS
from experiments.reporting.columns import COLUMNS, Column, display_name
from experiments.reporting.text import markdown_text, percent, printable, tex_text


@dataclass(frozen=True)
class Table:
    """Values and how they are shown.

    Attributes:
        name: stem of its files, and its anchor on the page.
        title: what it shows, on which frames.
        data: the values, as the CSV has them.
        shown: names of the columns that are shown, in their order; all but bounds, if empty.
        columns: how they are shown, before :data:`COLUMNS`.
        note: how to read it.
        commands: what makes it again.
        folded: whether the page shows it only when it is asked for.
        key: names of the columns that tell its rows apart, by which own results are compared with
            the reference; nothing is compared without.
    """

    name: str
    title: str
    data: pd.DataFrame
    shown: Sequence[str] = ()
    columns: Mapping[str, Column] = field(default_factory=dict)
    note: str = ""
    commands: Sequence[str] = ()
    folded: bool = False
    key: Sequence[str] = ()

    @property
    def names(self) -> list[str]:
        """Names of the columns that are shown."""
        if self.shown:
            return list(self.shown)
        every = [str(name) for name in self.data.columns]
        return [name for name in every if not name.endswith(("_low", "_high"))]

    def column(self, name: str) -> Column:
        """How a column is shown; one named after a model has shares of right samples."""
        known = self.columns.get(name) or COLUMNS.get(name)
        if known:
            return known
        if (CONFIGS / "model" / f"{name}.yaml").exists():
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
        parts = [f"**{markdown_text(self.title)}**", table, markdown_text(self.notes)]
        return "\n\n".join(filter(None, parts)) + "\n"


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
