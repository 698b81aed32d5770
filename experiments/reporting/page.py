"""The page, report.html: own results first, then what the reference has besides.

It needs no network. Figures and tables lie as files beside it, and it links to them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import jinja2
import pandas as pd

from experiments.reporting.study import Figure
from experiments.reporting.table import Table

ROWS = 30  # of a table that is not folded away


@dataclass(frozen=True)
class Section:
    """The answer to one question.

    Attributes:
        name: its anchor.
        title, text: heading, and what is asked.
        tables, figures: its answers.
        failures: what could not be made of it, a line each.
    """

    name: str
    title: str
    text: str
    tables: Sequence[Table]
    figures: Sequence[Figure] = ()
    failures: Sequence[str] = ()


@dataclass(frozen=True)
class Part:
    """The sections of one set of results.

    Attributes:
        name: ``mine`` or ``reference``, begins the anchors.
        title: heading.
        about: where the results are from.
        folder: of tables and figures, relative to the page.
        sections: unfolded if `unfolded`.
        of_reference: figures of the reference by name, relative to the page.
    """

    name: str
    title: str
    about: str
    folder: str
    sections: Sequence[Section]
    unfolded: bool = False
    of_reference: Mapping[str, str] = field(default_factory=dict)


def render(
    parts: Sequence[Part], differing: pd.DataFrame, problems: Sequence[str]
) -> str:
    """The page's HTML.

    Args:
        parts: sets of results, one's own first.
        differing: numbers of one's own that differ from the reference, which is shown beside them
            (:func:`experiments.reporting.compare.compare`).
        problems: what was left out, a line each.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["quote"] = quote
    place = differing[["table", "row", "column"]].itertuples(index=False, name=None)
    return environment.get_template("page.html").render(
        parts=parts,
        differing=differing.to_dict("records"),
        problems=problems,
        beside=dict(zip(place, differing.bounds, strict=True)),
        most_rows=ROWS,
    )
