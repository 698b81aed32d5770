"""The page: the answer of every study in one file that needs no network, report.html."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
from PIL import Image

from experiments.reporting.study import Plot
from experiments.reporting.table import Table

TEMPLATES = Path(__file__).parent / "templates"
COLUMNS = 8  # of a table that are shown at first
ROWS = 30  # of a table that is not folded away
_NUMBER = re.compile(
    r"[-+−]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?( k?M?B)?( [\[(].*)?", re.IGNORECASE
)
_TONES = {
    "yes": "good", "no": "bad", "partly": "plain", "fitted": "plain",
    "agrees": "good", "same": "good", "holds": "good", "differs": "bad", "fails": "bad",
}  # fmt: skip


@dataclass(frozen=True)
class Picture:
    """A figure as drawn: what it is, and its file."""

    plot: Plot
    data: bytes

    @property
    def source(self) -> str:
        """A data URI."""
        kind = "svg+xml" if self.plot.kind == "svg" else self.plot.kind
        return f"data:image/{kind};base64,{base64.b64encode(self.data).decode()}"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px: known before it is drawn, so that links land where they should."""
        if self.plot.kind != "svg":
            return Image.open(io.BytesIO(self.data)).size
        points = re.findall(rb'\b(?:width|height)="([\d.]+)pt"', self.data[:1000])[:2]
        width, height = (round(float(text) * 4 / 3) for text in points)
        return width, height


@dataclass(frozen=True)
class Block:
    """The answer of one set of results: ``mine``, ``reference``, or nameless where it is alone."""

    name: str = ""
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True)
class Section:
    """A part of the page, with its anchor."""

    name: str
    title: str
    text: str = ""
    blocks: Sequence[Block] = field(default_factory=list)
    open: bool = False  # not folded away at first
    failures: Sequence[str] = ()  # what could not be made of it, a line each


def render(
    sections: Sequence[Section],
    problems: Sequence[str],
    about: Mapping[str, str],
) -> str:
    """The page's HTML; `about`: name of a set of results → where it comes from."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"tone": _tone, "kinds": _kinds}
    return environment.get_template("report.html").render(
        sections=sections,
        problems=problems,
        about=about,
        most_rows=ROWS,
        most_columns=COLUMNS,
    )


def _kinds(table: Table) -> list[str]:
    """How each column is set: number, long text or text."""
    if not len(table.data):
        return [_kind(()) for _ in table.heads]
    columns = zip(*table.cells(), strict=True)
    return [_kind(texts) for texts in columns]


def _kind(texts: Sequence[str]) -> str:
    texts = [text for text in texts if text not in ("", "–")]
    if texts and all(map(_NUMBER.fullmatch, texts)):
        return "number"
    longest = max(map(len, texts), default=0)
    return "long" if longest > 30 else "text"


def _tone(verdict: str) -> str:
    """Colour of a verdict, by its last word before a colon."""
    before_colon, _, _ = verdict.partition(":")
    last_word = re.split(r"\W+", before_colon.lower())[-1]
    return _TONES.get(last_word, "none")
