"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads own results and the committed reference, never trains, and writes ``tables/``, ``figures/``
and ``report.html`` into the folder of own results: paper, reference and mine side by side. A record
that cannot be used is named and skipped.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Container, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table as TerminalTable
from rich.text import Text

from experiments import studies
from experiments.records.files import REFERENCE, results_dir
from experiments.records.measurement import Measured
from experiments.records.results import Results, Run
from experiments.reporting import comparison
from experiments.reporting.page import page
from experiments.reporting.page.page import Block, Picture, Section
from experiments.reporting.rows import runs_table
from experiments.reporting.study import Plot, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table
from experiments.reporting.text import printable
from hdc.io import write_atomically

WIDTH = 100  # columns of the terminal that Table I needs
MOST_RUNS = 200  # that the page lists; runs.csv lists all
SHOWN = (  # columns of it
    *(
        "model",
        "published_training_time_s",
        "training_time_s",
        "published_test_accuracy",
    ),
    "test_accuracy_final",
)


@dataclass
class Answers:
    """Tables and figures of every study for one set of results, ``reference`` or ``mine``."""

    name: str
    results: Results
    questions: Sequence[Study]
    tables: dict[str, list[Table]] = field(default_factory=dict)
    pictures: dict[str, list[Picture]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for study in self.questions:
            self.tables[study.name] = list(study.tables_of(self.results))
        quantities = (
            q for study in self.questions for q in study.quantities_of(self.results)
        )
        self.tables["comparison"] = [comparison.compare(quantities)]
        self.tables["runs"] = [runs_table(self.results)]

    def draw(self, drawn: Path | None = None, others: Container[str] = ()) -> None:
        """Draw every figure but some, or take it from a folder where it was drawn before."""
        for study in self.questions:
            plots = (
                plot for plot in study.plots_of(self.results) if plot.name not in others
            )
            self.pictures[study.name] = [
                Picture(plot, _drawn(plot, drawn)) for plot in plots
            ]

    def write(self, folder: Path) -> list[Path]:
        """Write tables and figures as files, and remove those of an earlier report; the files."""
        texts = {}
        for table in itertools.chain(*self.tables.values()):
            if table.name != "runs":
                texts[f"tables/{table.name}.md"] = table.markdown()
            elif self.name == "reference":
                continue  # runs.jsonl has them
            texts[f"tables/{table.name}.csv"] = table.csv()
        for name, text in texts.items():
            write_atomically(folder / name, text)
        written = [folder / name for name in texts]
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for picture in itertools.chain(*self.pictures.values()):
            written.append(
                folder / "figures" / f"{picture.plot.name}.{picture.plot.kind}"
            )
            written[-1].write_bytes(picture.data)
        there = {
            path for name in ("tables", "figures") for path in (folder / name).iterdir()
        }
        for path in there.difference(written):
            path.unlink()
        return written


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.report", description=__doc__
    )
    parser.parse_args(arguments)
    try:
        write(results_dir(), Console(width=WIDTH, highlight=False))
    except (OSError, ValueError) as error:  # a full disk, a missing published.csv
        sys.exit(f"error: {error}")


def write(folder: Path, console: Console) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file."""
    folder.mkdir(
        parents=True, exist_ok=True
    )  # a folder that cannot be written fails first
    questions = studies_of(studies)
    reference = Answers("reference", Results(REFERENCE), questions)
    mine = Answers("mine", Results(folder), questions)
    sets = [answers for answers in (mine, reference) if answers.results] or [mine]
    mine.draw()
    own = {picture.plot.name for picture in itertools.chain(*mine.pictures.values())}
    reference.draw(
        REFERENCE / "figures", own
    )  # one's own figure stands for the reference's
    (mine if mine.results else reference).write(folder)
    sections = [
        Section(s.name, s.title, s.question, _blocks(s.name, sets), s.front)
        for s in questions
    ]
    compared = Section(
        "comparison", "Every published number", "", _blocks("comparison", sets)
    )
    sections.insert(sum(study.front for study in questions), compared)
    if mine in sets and len(mine.results.runs) <= MOST_RUNS:
        sections.append(Section("runs", "Every run", "", _blocks("runs", [mine])))
    problems = [f"{a.name}: {text}" for a in sets for text in a.results.problems]
    about = {answers.name: _about(answers) for answers in sets}
    path = folder / "report.html"
    write_atomically(path, page.render(sections, problems, about))
    for answers in sets:
        _show_table1(answers, console)
    for name, text in about.items():
        console.print(Text(printable(f"{name}: {text}"), "dim"))
    print_problems(console, sets)
    console.print(f"page: {os.path.relpath(path)}", soft_wrap=True)
    return path


def _blocks(name: str, sets: Sequence[Answers]) -> list[Block]:
    blocks = []
    for answers in reversed(sets):  # the complete reference stands before first looks
        tables, pictures = answers.tables[name], answers.pictures.get(name, [])
        if tables or pictures:
            blocks.append(
                Block(answers.name if len(sets) > 1 else "", tables, pictures)
            )
    return blocks


def _about(answers: Answers) -> str:
    """How many records there are, of which code, from which machine."""
    results = answers.results
    records: list[Run | Measured] = [*results.runs, *results.measurements]
    machines = {
        (r.record.environment.cpu, r.record.environment.threads) for r in records
    }
    where = "; ".join(f"{cpu}, {threads} threads" for cpu, threads in sorted(machines))
    counts = f"{len(results.runs)} runs and {len(results.measurements)} measurements on {where}"
    counts += f" ({'tables/runs.csv' if answers.name == 'mine' else 'runs.jsonl'} has every run)"
    old = [record for record in records if record.outdated]
    if not old:
        return f"{counts}, all by this code"
    files = sorted({name for record in old for name in record.outdated})
    return f"{counts}; {len(old)} by other code, {len(files)} files changed since: {files[0]} …"


def _drawn(plot: Plot, folder: Path | None) -> bytes:
    from experiments.reporting.plot import save  # --help does not wait for matplotlib

    file = folder and folder / f"{plot.name}.{plot.kind}"
    return file.read_bytes() if file and file.exists() else save(plot.draw(), plot.kind)


def _show_table1(answers: Answers, console: Console) -> None:
    """Times and accuracies of Table I, of the paper and of a set of results."""
    for table in (
        table for table in answers.tables["table1"] if table.name == "table1"
    ):
        short = replace(table, shown=SHOWN)
        shown = TerminalTable(
            *short.heads, title=f"Table I, {answers.name}", box=box.SIMPLE_HEAD
        )
        for row in short.cells():
            shown.add_row(*(Text(printable(cell)) for cell in row))
        console.print(shown)


def print_problems(console: Console, sets: Sequence[Answers]) -> None:
    for answers in sets:
        for problem in answers.results.problems:
            text = f"left out of {answers.name}: {printable(problem)}"
            console.print(escape(text), style="yellow", soft_wrap=True, emoji=False)


if __name__ == "__main__":
    main()
