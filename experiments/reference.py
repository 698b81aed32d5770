"""For maintainers: own results become the committed reference: ``python -m experiments.reference``.

Each record of own results takes the place of that of the reference with its name, unless it was
made with changes that are in no commit, or by code of other revisions. Without a file of records in
the reference, own results are all of it. Tables and figures are made again, and the marked parts of
README.md and of the docs are filled from them; code of which records have another revision is
named.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from experiments import report, studies
from experiments.records import store
from experiments.records.console import say
from experiments.records.files import REFERENCE, ROOT, results_dir
from experiments.records.results import Results
from experiments.reporting import documents
from experiments.reporting.answers import Answers
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table
from experiments.studies.claims import findings
from hdc.io import write_atomically

README, DOCS = ROOT / "README.md", ROOT / "docs"


def main(arguments: list[str] | None = None) -> int:
    """Carry it out; 1 if a record is of another revision."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.reference", description=__doc__
    )
    parser.add_argument(
        "--tables",
        action="store_true",
        help="only tables, figures, and the marked parts of README and docs",
    )
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    if not chosen.tables:
        entered, left_out = adopt(results_dir(), REFERENCE)
        text = f"{entered} records taken over"
        if left_out:
            text += f"; {left_out} left out: of other revisions, or in no commit"
        say(console, text)
    answers = Answers("reference", Results(REFERENCE), studies_of(studies))
    written = answers.write(REFERENCE)
    report.print_problems(console, [answers])
    say(console, f"{len(written)} files in {os.path.relpath(REFERENCE)}")
    contents = parts(answers)
    for page in (README, *sorted(DOCS.glob("*.md"))):
        text = page.read_text(encoding="utf-8")
        filled = documents.fill(text, contents)
        if filled != text:
            write_atomically(page, filled)
            say(console, f"parts of {os.path.relpath(page)}")
    changed = Counter(
        name for record in answers.results.finished for name in record.outdated
    )
    for name, n in sorted(changed.items()):
        say(console, f"{name}: {n} records are of another")
    return 1 if changed else 0


def adopt(own: Path, reference: Path) -> tuple[int, int]:
    """Put the records of a folder of own results into that of the reference; how many enter, how
    many are left out."""
    made = Results(own).finished
    entering = [r for r in made if r.environment.is_of_a_commit and not r.outdated]
    before = Results(reference).finished
    records = {record.id: record for record in (*before, *entering)}
    store.write_all(reference, (records[name] for name in sorted(records)))
    return len(entering), len(made) - len(entering)


def parts(answers: Answers) -> dict[str, Callable[[], str]]:
    """Contents of the marked parts of README.md and of the docs, by their names."""

    def of(name: str, made: Callable[[Table], str]) -> Callable[[], str]:
        def part() -> str:
            table = answers.table(name)
            return documents.NOT_MEASURED if table is None else made(table)

        return part

    return {
        "findings": lambda: _findings(answers),
        "opening": of("recording_costs", documents.opening),
        "forms": of("recording_costs", documents.forms),
        "costs": of("recording_costs", documents.costs),
        "table1": of("table1", documents.table1),
        "results": lambda: documents.results_page(
            answers, findings.sentences(findings.ANSWERS, answers)
        ),
        "verdicts": of("verdicts", Table.rows),
        "claims": of("claims", Table.rows),
        "models": documents.model_list,
    }


def _findings(answers: Answers) -> str:
    """Findings, a sentence per item."""
    found = findings.sentences(findings.FINDINGS, answers)
    items = enumerate(found.values(), 1)
    lines = [f"{number}. {text}" for number, text in items]
    return "\n".join(lines) or documents.NOT_MEASURED


if __name__ == "__main__":
    sys.exit(main())
