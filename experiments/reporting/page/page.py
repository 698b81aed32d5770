"""The page: the answer of every study in one file that needs no network, report.html."""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import jinja2
from PIL import Image

from experiments.reporting.against import Comparison
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.study import Plot
from experiments.reporting.table import Table, records

TEMPLATES = Path(__file__).parent / "templates"
COLUMNS = 8  # of a table that are shown at first
ROWS = 30  # of a table that is not folded away
FEW_ROWS = 8  # of a table in which a reader needs no search
OWN = "mine"
# Columns by which rows of all tables are filtered, with what a value is called.
FILTERS: Mapping[str, Callable[[str], str]] = {
    "scene": scene_name,
    "model": display_name,
}
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

    @cached_property
    def chart(self) -> dict[str, Any] | None:
        """Its interactive form as Vega-Lite, if it has one; built when it is first asked for."""
        chart = getattr(self.plot, "chart", None)
        return chart() if chart is not None else None

    @property
    def source(self) -> str:
        """A data URI; of an SVG nothing, as the page unpacks :attr:`packed`."""
        if self.plot.kind == "svg":
            return ""
        text = base64.b64encode(self.data).decode()
        return f"data:image/{self.plot.kind};base64,{text}"

    @property
    def packed(self) -> str:
        """An SVG as :func:`pack` has it; a fifth of its size."""
        return pack(self.data) if self.plot.kind == "svg" else ""

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
    environment.filters |= {
        "tone": _tone,
        "kinds": _kinds,
        "about_rows": _about_rows,
        "packed_json": _packed_json,
    }

    def outside_of(table: Table, block: str) -> Sequence[set[str]]:
        if against is None or block != OWN:
            return [set()] * len(table.data)
        return against.outside_of(table)

    return environment.get_template("report.html").render(
        sections=sections,
        problems=problems,
        about=about,
        outside_of=outside_of,
        compared=against is not None,
        choices=_choices(sections),
        charts=_charts(sections),
        most_rows=ROWS,
        few_rows=FEW_ROWS,
        most_columns=COLUMNS,
    )


def _pictures(sections: Sequence[Section]) -> Iterator[Picture]:
    for section in sections:
        for block in section.blocks:
            yield from block.pictures


def _choices(sections: Sequence[Section]) -> dict[str, dict[str, str]]:
    """What each filter of rows can choose, with its name as shown."""
    found: dict[str, dict[str, str]] = {key: {} for key in FILTERS}
    for section in sections:
        for block in section.blocks:
            for table in block.tables:
                for about in _about_rows(table):
                    for key in FILTERS.keys() & about:
                        found[key][about[key]] = FILTERS[key](about[key])
    return {key: dict(sorted(names.items())) for key, names in found.items()}


def _about_rows(table: Table) -> list[dict[str, str]]:
    """Of each row its scene and its model, as far as it has them, and a ``title`` for a reader who
    points at it: how many seeds it has, and its own command, if it has one."""
    found = []
    for row in records(table.data):
        about = {key: row[key] for key in FILTERS if isinstance(row.get(key), str)}
        if isinstance(row.get("recording"), str):
            about["scene"] = row["recording"]
        seeds = f"{row['seeds']} seeds" if row.get("seeds") else ""
        about["title"] = "\n".join(filter(None, [seeds, row.get("command")]))
        found.append(about)
    return found


def pack(data: bytes) -> str:
    """Bytes as gzip in base64, the same for the same bytes; report.js unpacks them."""
    return base64.b64encode(gzip.compress(data, mtime=0)).decode()


def _packed_json(value: Any) -> str:
    return pack(json.dumps(value, separators=(",", ":")).encode())


def _charts(sections: Sequence[Section]) -> str:
    """The library that draws interactive figures, packed; empty if there is none."""
    if not any(picture.chart for picture in _pictures(sections)):
        return ""
    from experiments.reporting.page.charts import library  # slow to load

    return pack(library().encode())


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
