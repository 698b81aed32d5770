"""The page: the tables of every study beside its figures, report.html.

The figures are the files in ``figures/`` beside the page; nothing comes from a network.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
from PIL import Image

from experiments.reporting.against import Comparison
from experiments.reporting.study import Plot
from experiments.reporting.table import Table

TEMPLATES = Path(__file__).parent / "templates"
COLUMNS = 8  # of a table that the page shows; its CSV has all
ROWS = 30  # of a table that is not folded away
_NUMBER = re.compile(
    r"[-+−]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?( k?M?B)?( [\[(].*)?", re.IGNORECASE
)


@dataclass(frozen=True)
class Picture:
    """A figure as drawn: what it is, and its file."""

    plot: Plot
    data: bytes

    @property
    def source(self) -> str:
        """Address of its file, from the page."""
        return f"figures/{self.plot.name}.{self.plot.kind}"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px: known before it is loaded, so that links land where they should."""
        if self.plot.kind != "svg":
            return Image.open(io.BytesIO(self.data)).size
        points = re.findall(rb'\b(?:width|height)="([\d.]+)pt"', self.data[:1000])[:2]
        width, height = (round(float(text) * 4 / 3) for text in points)
        return width, height


@dataclass(frozen=True)
class Section:
    """A part of the page, with its anchor."""

    name: str
    title: str
    text: str = ""
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    open: bool = False  # not folded away at first
    failures: Sequence[str] = field(
        default_factory=list
    )  # what could not be made of it


def render(
    sections: Sequence[Section],
    problems: Sequence[str],
    about: Mapping[str, str],
    against: Comparison | None = None,
) -> str:
    """The page's HTML.

    Args:
        sections: its parts.
        problems: what was left out, a line each.
        about: name of a set of results → where it comes from.
        against: own results against the reference, whose cells outside are marked.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["kinds"] = _kinds

    def outside_of(table: Table) -> Sequence[set[str]]:
        if against is None:
            return [set()] * len(table.data)
        return against.outside_of(table)

    return environment.get_template("report.html").render(
        sections=sections,
        problems=problems,
        about=about,
        outside_of=outside_of,
        most_rows=ROWS,
        most_columns=COLUMNS,
    )


def _kinds(table: Table) -> list[str]:
    """How each column is set: as numbers or as text."""
    if not len(table.data):
        return ["text"] * len(table.heads)
    columns = zip(*table.cells(), strict=True)
    return [_kind(texts) for texts in columns]


def _kind(texts: Sequence[str]) -> str:
    known = [text for text in texts if text not in ("", "–")]
    are_numbers = bool(known) and all(map(_NUMBER.fullmatch, known))
    return "number" if are_numbers else "text"
