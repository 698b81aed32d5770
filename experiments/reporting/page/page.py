"""The page: the answer of every study in one file that needs no network, report.html.

The template escapes every text that is put into it.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

import jinja2
from markupsafe import Markup

from experiments.reporting.study import Plot
from experiments.reporting.table import Table

TEMPLATES = Path(__file__).parent / "templates"
# A number, its unit of size if it has one, and what stands in brackets behind it.
_NUMBER = re.compile(r"[-+−]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?( k?M?B)?( [\[(].*)?", re.IGNORECASE)
_LONG = 30  # rows of a table that is folded away until asked for
_PLAIN = " !$'()*+,-./:;<=>?@[]_~\n"  # what a data URI takes as it is


@dataclass(frozen=True)
class Picture:
    """A figure as drawn.

    Attributes:
        plot: what it is.
        data: the file.
    """

    plot: Plot
    data: bytes

    @property
    def source(self) -> Markup:
        """A data URI that may stand in an attribute in double quotes."""
        if self.plot.kind == "svg":  # a third shorter than base64, which would escape every byte
            # Quotes of the other kind around attributes need no escape here.
            text = re.sub(r'="([^"\'<>]*)"(?=[^<>]*>)', r"='\1'", self.data.decode())
            return Markup(f"data:image/svg+xml,{quote(text, safe=_PLAIN)}")
        return Markup(f"data:image/webp;base64,{base64.b64encode(self.data).decode()}")


@dataclass(frozen=True)
class Block:
    """What one set of results says to a question.

    Attributes:
        name: ``mine``, ``reference``, or nothing where there is one set only.
    """

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


def render(
    sections: Sequence[Section],
    problems: Sequence[str],
    about: Mapping[str, str],
    minutes: Mapping[str, float] = MappingProxyType({}),
) -> str:
    """The page's HTML.

    Args:
        sections: in their order.
        problems: what was left out, and why.
        about: name of a set of results → where it comes from.
        minutes: name of an experiment → what it takes on 2 cores, shown beside its command.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["tone"] = _tone
    environment.filters["kinds"] = _kinds
    environment.filters["minutes"] = partial(_minutes, minutes)
    return environment.get_template("report.html").render(
        sections=sections,
        problems=problems,
        about=about,
        long=_LONG,
    )


def _minutes(known: Mapping[str, float], command: str) -> str:
    """How long a command takes, where it is known: `` about 3 min on 2 cores``."""
    found = re.search(r"\bexperiment=(\w+)", command)
    taken = known.get(found[1]) if found else None
    return f" about {max(1, round(taken))} min on 2 cores" if taken else ""


def _kinds(table: Table) -> list[str]:
    """What each column holds: number, code, long text or text."""
    cells = table.cells()
    columns = zip(*cells, strict=True) if cells else ([] for _ in table.heads)
    return [_kind([text for text in column if text not in ("", "–")]) for column in columns]


def _kind(texts: Sequence[str]) -> str:
    if texts and all(map(_NUMBER.fullmatch, texts)):
        return "number"
    if any(text.startswith("python ") for text in texts):
        return "code"
    return "long" if any(len(text) > 30 for text in texts) else "text"


def _tone(verdict: str) -> str:
    """How a verdict is coloured: good, bad, plain or none."""
    if "differs" in verdict or verdict in ("no", "fails"):
        return "bad"
    if "agrees" in verdict or verdict in ("holds", "setting, same"):
        return "good"
    return "plain" if verdict == "fitted" else "none"
