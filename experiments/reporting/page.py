"""The page, report.html: own results first, then what the reference has besides.

It needs no network. Figures and tables lie as files beside it, and it links to them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2

from experiments.reporting.answers import Answers
from experiments.reporting.study import Study

ROWS = 30  # of a table that is not folded away
PARTS = ("tables", "figures", "failures")  # of a study, besides itself


def render(
    sets: Sequence[Answers],
    about: Sequence[tuple[str, str, str]],
    differing: Sequence[Any],
    problems: Sequence[str],
) -> str:
    """The page's HTML.

    Args:
        sets: of results, one's own first.
        about: of each set its heading, where its results are from, and the folder of its tables
            and figures, relative to the page.
        differing: numbers of one's own that differ from the reference, rows of
            :func:`experiments.reporting.compare.compare`.
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
    parts = zip(sets, about, sections(sets), strict=True)
    return environment.get_template("page.html").render(
        parts=[part for part in parts if part[2]],
        differing=differing,
        problems=problems,
        most_rows=ROWS,
    )


def sections(sets: Sequence[Answers]) -> Iterator[list[dict[str, Any]]]:
    """The studies of each set, with the tables and figures that no set before it has."""
    shown: set[str] = set()
    for answers in sets:
        every = [_section(answers, study, shown) for study in answers.every_study]
        yield [each for each in every if any(each[part] for part in PARTS)]
        shown |= {
            made.name for each in every for made in (*each["tables"], *each["figures"])
        }


def _section(answers: Answers, study: Study, shown: set[str]) -> dict[str, Any]:
    return {
        "study": study,
        "tables": [t for t in answers.tables(study) if t.name not in shown],
        "figures": [f for f in answers.figures(study) if f.name not in shown],
        "failures": [text for name, text in answers.failures if name == study.name],
    }
