"""For maintainers: own results become the committed reference: ``python -m experiments.reference``.

What finished steps of the reproduction left in the folder of own results replaces what
``results/reference`` has of these steps; other steps stay as they are, so that a reproduction can
be taken over step by step. Tables and figures are made again, and the marked parts of README.md and
of the docs are filled from them; tables that rest on records of older code are named.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial

import pandas as pd
from rich.console import Console

from experiments import report, studies
from experiments.protocol.sweep import span
from experiments.records.files import REFERENCE, ROOT, results_dir
from experiments.records.results import Results
from experiments.reporting import documents
from experiments.reporting.study import studies as studies_of
from experiments.reproduction import took
from experiments.reproduction.adopt import Adopted, adopt
from experiments.reproduction.steps import steps
from experiments.studies.claims import findings
from hdc.io import write_atomically

README, DOCS = ROOT / "README.md", ROOT / "docs"
COMMANDS = {
    "full": "make reproduce",
    "quick": "make reproduce QUICK=1",
}


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
        adopted = adopt(results_dir(), REFERENCE)
        _tell(adopted, console)
    answers = report.Answers("reference", Results(REFERENCE), studies_of(studies))
    written = answers.write(REFERENCE)
    report.print_problems(console, [answers])
    console.print(
        f"{len(written)} files in {os.path.relpath(REFERENCE)}", soft_wrap=True
    )
    contents = readme_parts(answers) | docs_parts(answers)
    for page in (README, *sorted(DOCS.glob("*.md"))):
        text = page.read_text(encoding="utf-8")
        filled = documents.fill(text, contents)
        if filled != text:
            write_atomically(page, filled)
            console.print(f"parts of {os.path.relpath(page)}")
    return _tell_older(answers, console)


def _tell(adopted: Adopted, console: Console) -> None:
    """Lines on what entered the reference, and what did not."""
    text = f"{adopted.entered} records taken over, {adopted.left} have left"
    if adopted.outside:
        text += f"; {adopted.outside} stay outside: no finished step has them"
    console.print(text, soft_wrap=True)


def _tell_older(answers: report.Answers, console: Console) -> int:
    """Name the code of other revisions and the tables that rest on it; 1 if there are any."""
    changed = Counter[str]()
    for record in answers.results.finished:
        changed.update(record.outdated)
    for name, n in sorted(changed.items()):
        console.print(f"{name}: {n} records are of another", soft_wrap=True)
    older = answers.older_tables()
    if older:
        text = f"tables with records of older code: {', '.join(older)}"
        console.print(text, soft_wrap=True)
    return 1 if changed else 0


def readme_parts(answers: report.Answers) -> dict[str, Callable[[], str]]:
    """Contents of the marked parts of README.md, by their names."""
    return {
        "findings": partial(_findings, answers.results),
        "costs": partial(documents.costs, _table("recording_costs")),
        "table1": partial(_rows, "table1"),
    }


def docs_parts(answers: report.Answers) -> dict[str, Callable[[], str]]:
    """Contents of the marked parts of the docs, by their names."""
    return {
        "results": partial(
            documents.results_page, answers.questions, answers.tables, answers.plots
        ),
        "scenes": partial(documents.scene_list, answers.results),
        "benchmark_goals": partial(_rows, "benchmark_goals"),
        "claims": lambda: documents.named(_rows("claims")),
        "reproduction": _reproduction,
    }


def _findings(results: Results) -> str:
    """Findings, a sentence per item."""
    frame = results.frame(*findings.OF)
    costs, table1 = _table("recording_costs"), _table("table1")
    sentences = findings.findings(frame, costs, table1)
    items = [f"{place}. {text}" for place, text in enumerate(sentences, 1)]
    return "\n".join(items) or documents.NOT_MEASURED


def _table(name: str) -> pd.DataFrame | None:
    """A committed table with all its columns; None where it was not measured."""
    path = REFERENCE / "tables" / f"{name}.csv"
    return pd.read_csv(path) if path.exists() else None


def _rows(name: str) -> str:
    """The rows of a table, without title and note."""
    path = REFERENCE / "tables" / f"{name}.md"
    rows = []
    if path.exists():
        lines = path.read_text("utf-8").splitlines()
        rows = [line for line in lines if line.startswith("|")]
    return "\n".join(rows) or documents.NOT_MEASURED


def _reproduction() -> str:
    """How many steps each command took, their time added up, and the most memory one needed."""
    rows = list(took.read(REFERENCE).values())
    texts = []
    for mode, command in COMMANDS.items():
        names = [step.name for step in steps(mode)]
        of_mode = [row for row in rows if row["mode"] == mode and row["step"] in names]
        done = [row for row in of_mode if row["status"] == took.FINISHED]
        if not done:
            continue
        most = max(int(row["peak_bytes"]) for row in done) / 1e9
        time = span(sum(took.wall_seconds(row) for row in done))
        counts = f"{len(done)} of {len(names)} steps"
        texts.append(f"`{command}`, {counts}: {time}, {most:.1f} GB")
    if not texts:
        return documents.NOT_MEASURED
    return "; ".join(texts) + "."


if __name__ == "__main__":
    sys.exit(main())
