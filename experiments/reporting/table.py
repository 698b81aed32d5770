"""A table: rows of values, and what their cells look like in CSV, Markdown, LaTeX and HTML."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

Row = Mapping[str, Any]
Columns = Mapping[str, Callable[[Row], str]]
"""Head of a column → what its cell says of a row."""


@dataclass(frozen=True)
class Table:
    """Rows and how they are shown.

    Attributes:
        name: stem of its files, and its anchor on the page.
        title: what it shows, on which frames.
        data: the values, a column a quantity, as the CSV has them.
        columns: cells as shown; without any, every column of `data`.
        note: how to read it.
        commands: what makes it again.
        key: heads of the columns that tell its rows apart, for :func:`beside`.
        common: heads of columns that are the same whoever measured.
        folded: whether the page shows it only when it is asked for.
    """

    name: str
    title: str
    data: pd.DataFrame
    columns: Columns = field(default_factory=dict)
    note: str = ""
    commands: Sequence[str] = ()
    key: Sequence[str] = ()
    common: Sequence[str] = ()
    folded: bool = False

    @property
    def heads(self) -> list[str]:
        """Heads of the columns as shown."""
        return list(self.columns) or [str(c).replace("_", " ") for c in self.data.columns]

    def cells(self) -> list[list[str]]:
        """Texts, a list a row."""
        rows = records(self.data)
        if not self.columns:
            return [[number(value, 4) for value in row.values()] for row in rows]
        return [[cell(row) for cell in self.columns.values()] for row in rows]

    def csv(self) -> str:
        """Comma-separated values; what is unknown is empty, numbers have six digits."""
        shown = self.data.map(_exact) if len(self.data) else self.data
        return shown.to_csv(index=False, lineterminator="\n")

    def markdown(self) -> str:
        """The table with its title above and its note below."""
        lines = [self.heads, ["---"] * len(self.heads)]
        lines += [[markdown_text(cell) for cell in row] for row in self.cells()]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        parts = [f"**{markdown_text(self.title)}**", table, markdown_text(self.note)]
        return "\n\n".join(filter(None, parts)) + "\n"

    def latex(self) -> str:
        """The table for LaTeX (package booktabs), caption above, note below."""
        # A head is broken where it has commas.
        broken = (_tex(head).replace(", ", r" \\ ") for head in self.heads)
        heads = [rf"\shortstack{{{head}}}" for head in broken]
        body = [" & ".join(map(_tex, row)) + r" \\" for row in self.cells()]
        return "\n".join(
            [
                "% needs \\usepackage{booktabs}",
                r"\begin{table*}",
                r"\centering",
                r"\scriptsize",
                rf"\caption{{{_tex(self.title)}}}",
                rf"\label{{tab:{self.name}}}",
                rf"\begin{{tabular}}{{l{'r' * (len(heads) - 2)}l}}",
                r"\toprule",
                " & ".join(heads) + r" \\",
                r"\midrule",
                *body,
                r"\bottomrule",
                r"\end{tabular}",
                "",
                rf"\medskip\raggedright {_tex(self.note)}",
                r"\end{table*}",
                "",
            ]
        )


def frame(rows: Iterable[Row], columns: Sequence[str] = ()) -> pd.DataFrame:
    """Rows as a data frame that keeps integers and texts as they are; None where there is nothing.

    Args:
        rows: mappings.
        columns: which, in this order; those of the rows if there are none.
    """
    rows = list(rows)
    names = list(columns) or list(dict.fromkeys(key for row in rows for key in row))
    return pd.DataFrame([[row.get(n) for n in names] for row in rows], columns=names, dtype=object)


def records(data: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a data frame as mappings; NaN is None."""
    return [
        {
            str(key): None if value is None or value is pd.NA or value != value else value
            for key, value in row.items()
        }
        for row in data.to_dict("records")
    ]


def beside(ours: Table, theirs: Table) -> Table:
    """Two tables of the same columns as one, so that each value stands beside its other.

    Args:
        ours, theirs: their ``key`` says which rows are the same, ``common`` what need not be shown
            twice.
    """
    once = [*ours.key, *ours.common]

    def keyed(table: Table) -> dict[tuple[str, ...], dict[str, str]]:
        rows = (dict(zip(table.heads, cells, strict=True)) for cells in table.cells())
        return {tuple(row[key] for key in table.key): row for row in rows}

    one, other = keyed(ours), keyed(theirs)
    rows = []
    for key in dict.fromkeys([*other, *one]):
        mine, reference = one.get(key, {}), other.get(key, {})
        row = {}
        for head in ours.heads:
            if head in once:
                row[head] = mine.get(head) or reference.get(head, "–")
            else:
                row[f"{head}, reference"] = reference.get(head, "–")
                row[f"{head}, mine"] = mine.get(head, "–")
        rows.append(row)
    shown = frame(rows)
    columns = {head: (lambda row, head=head: row[head]) for head in shown.columns}
    return replace(ours, data=shown, columns=columns)


def number(value: Any, digits: int = 3) -> str:
    """A number to that many significant digits, a text as it is, nothing as a dash."""
    if value is None:
        return "–"
    if isinstance(value, str | bool) or not isinstance(value, int | float | np.number):
        return str(value)
    value = value.item() if isinstance(value, np.number) else value
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞"
    if isinstance(value, int) and abs(value) < 1e5:
        return str(value)
    if value and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{max(1, digits - 2)}e}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:.{decimals}f}"


def cell(key: str, show: Callable[[Any], str] = number) -> Callable[[Row], str]:
    """What shows this value of a row, nothing as a dash."""
    return lambda row: show(row.get(key))


def percent(value: float | None) -> str:
    """A fraction in percent, one decimal where it is not whole."""
    return "–" if value is None else f"{100 * value:.1f}".removesuffix(".0")


def points(difference: float | None) -> str:
    """A difference of two fractions in percentage points, with its sign; one decimal, or one digit
    of what would be nothing by that."""
    if difference is None or difference != difference:
        return "–"
    value = 100 * difference
    if abs(value) < 1e-9:
        return "0"
    return (f"{value:+.1f}" if abs(value) >= 0.05 else f"{value:+.1g}").replace("-", "−")


def interval(value: str, low: str, high: str) -> str:
    """``value [low, high]``; the value alone where the bounds are unknown."""
    return value if "–" in (value, low, high) else f"{value} [{low}, {high}]"


def bounded(name: str, row: Row, show: Callable[[Any], str] = percent) -> str:
    """``value [low, high]`` of a row's columns ``name``, ``name_low`` and ``name_high``."""
    return interval(*(show(row.get(f"{name}{end}")) for end in ("", "_low", "_high")))


def size(value: int | None) -> str:
    """Bytes in B, kB or MB."""
    if value is None:
        return "unknown"
    if value < 1e3:
        return f"{value} B"
    return f"{number(value / 1e3)} kB" if value < 1e6 else f"{number(value / 1e6)} MB"


def markdown_text(text: str) -> str:
    """Text as it is: what a record quotes makes no line, cell, tag, code or link of its own."""
    # An underscore within a word is no markup.
    signs = r"([\\`*|~]|(?<=\])[(\[:]|(?<![^\W_])_|_(?![^\W_]))"
    text = re.sub(signs, r"\\\1", printable(" ".join(text.split())))
    return text.replace("&", "&amp;").replace("<", "&lt;")


def printable(text: str) -> str:
    """Text with its control characters shown, as Python would write them."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


_TEX = {
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    **{letter: f"${letter}$" for letter in "<>|"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "×": r"$\times$",
    "–": "--",
    "−": "$-$",
    "…": "--",
    "“": "``",
    "”": "''",
    "∞": r"$\infty$",
}


def _tex(text: str) -> str:
    # TeX stops at control characters.
    return "".join(_TEX.get(letter, letter) for letter in printable(" ".join(text.split())))


def _exact(value: Any) -> str:
    """A value for a CSV; control characters of what a record quotes are shown, not kept."""
    if value is None or value != value:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(str(value))
