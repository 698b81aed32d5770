"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads own results and the committed reference, never trains, and writes ``tables/``, ``figures/``
and ``report.html`` into the folder of own results. The page shows own results, or the reference
where there are none. A record that cannot be used is named and skipped; a study that fails says so
in its own section, and the others are made.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.text import Text

from experiments import studies
from experiments.records.files import REFERENCE, results_dir
from experiments.records.measurement import Measured
from experiments.records.results import Results, Run
from experiments.reporting import comparison, listing
from experiments.reporting.against import Comparison, compare
from experiments.reporting.page import page
from experiments.reporting.page.page import Picture, Section
from experiments.reporting.rows import runs_table
from experiments.reporting.study import Failure, Plot, Quantity, Study, own_studies
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table
from experiments.reporting.terminal import last_line, show_table1
from experiments.reporting.text import counted, printable
from hdc.io import write_atomically

WIDTH = 100  # columns of the terminal that Table I needs
MOST_RUNS = 200  # that the page lists; runs.csv lists all


@dataclass
class Answers:
    """Tables and figures of every study for one set of results, ``reference`` or ``mine``.

    What fails is kept in ``failures`` by the name of its study; everything else is made.
    """

    name: str
    results: Results
    questions: Sequence[Study]
    tables: dict[str, list[Table]] = field(default_factory=dict)
    pictures: dict[str, list[Picture]] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)

    def __post_init__(self) -> None:
        quantities: list[Quantity] = []
        for study in self.questions:
            self.tables[study.name] = list(study.tables_of(self.results, self.failures))
            quantities += study.quantities_of(self.results, self.failures)
        # Under mine stands nothing that was not measured.
        every = comparison.compare(quantities, with_missing=self.name == "reference")
        self.tables["comparison"] = [every] if len(every.data) else []
        self.tables["runs"] = [runs_table(self.results)]

    def draw(
        self,
        drawn: Path | None = None,
        behind: Results | None = None,
    ) -> None:
        """Draw every figure, over other results where it can be, or take it from a folder where it
        was drawn before."""
        for study in self.questions:
            self.pictures[study.name] = []
            for plot in study.plots_of(self.results, self.failures):
                try:
                    over = plot.over(behind)
                    picture = Picture(over, _drawn(over, drawn))
                except Exception as error:
                    called = f"figure {plot.name}"
                    self.failures.append(Failure(study.name, called, error))
                else:
                    self.pictures[study.name].append(picture)

    def every_table(self) -> Iterator[Table]:
        """The tables of all studies, one after another."""
        return itertools.chain(*self.tables.values())

    @property
    def written(self) -> list[Table]:
        """The tables that get files: runs.jsonl has the runs of the reference."""
        is_reference = self.name == "reference"
        return [
            t for t in self.every_table() if not (is_reference and t.name == "runs")
        ]

    def older_tables(self) -> list[str]:
        """Names of the tables that rest on records of older revisions."""
        return listing.older_tables(self.written, self.results)

    def failures_of(self, study: str) -> list[str]:
        """What failed of a study, a line each."""
        return [str(failure) for failure in self.failures if failure.study == study]

    def write(self, folder: Path, tex: bool = False) -> list[Path]:
        """Write tables and figures as files, and remove those of an earlier report; the files."""
        texts: dict[str, str] = {}
        for table in self.written:
            texts |= self._texts_of(table, tex)
        texts[listing.README] = listing.readme(self.written, self.older_tables())
        for name, text in texts.items():
            write_atomically(folder / name, text)
        written = [folder / name for name in texts]
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for picture in itertools.chain(*self.pictures.values()):
            path = folder / "figures" / f"{picture.plot.name}.{picture.plot.kind}"
            path.write_bytes(picture.data)
            written.append(path)
        for name in ("tables", "figures"):
            for path in set((folder / name).iterdir()).difference(written):
                path.unlink()
        return written

    def _texts_of(self, table: Table, tex: bool) -> dict[str, str]:
        """The files of a table by name, with what they contain."""
        if table.name == "runs":
            return {"tables/runs.csv": table.csv()}
        texts = {f"tables/{table.name}.md": table.markdown()}
        if tex:
            texts[f"tables/{table.name}.tex"] = table.tex()
        texts[f"tables/{table.name}.csv"] = table.csv()
        return texts


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I once, and own numbers against the reference."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.report", description=__doc__
    )
    parser.add_argument(
        "--strict", action="store_true", help="exit with 1 if a study failed"
    )
    parser.add_argument(
        "--tex", action="store_true", help="write every table as LaTeX, too"
    )
    chosen = parser.parse_args(arguments)
    console = Console(width=WIDTH, highlight=False)
    try:
        sets = answers_of(results_dir())
        write(results_dir(), console, sets, tex=chosen.tex)
    except (OSError, ValueError) as error:  # a full disk, a missing published.csv
        sys.exit(f"error: {error}")
    if chosen.strict and any(answers.failures for answers in sets):
        sys.exit(1)


def answers_of(folder: Path) -> list[Answers]:
    """Own results and the reference, as far as they hold anything; one's own where neither does."""
    folder.mkdir(parents=True, exist_ok=True)  # one that cannot be written fails first
    own = Results(folder)
    questions = [*studies_of(studies), *own_studies(own)]
    mine = Answers("mine", own, questions)
    reference = Answers("reference", Results(REFERENCE), questions)
    return [answers for answers in (mine, reference) if answers.results] or [mine]


def write(
    folder: Path,
    console: Console,
    sets: Sequence[Answers] | None = None,
    tex: bool = False,
    brief: bool = False,
) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file.

    Args:
        folder: of own results.
        console: gets Table I, own numbers against the reference, where the records are from, and
            what was left out.
        sets: of :func:`answers_of` the folder, if they are there already.
        tex: write tables as LaTeX, too.
        brief: show Table I, what of it lies outside the reference, and what was left out.
    """
    sets = answers_of(folder) if sets is None else sets
    *own, last = sets
    for answers in own:  # own results are drawn over the reference
        answers.draw(behind=last.results)
    last.draw(REFERENCE / "figures" if last.name == "reference" else None)
    against = _against(sets)
    if against is not None and against.cells:
        sets[0].tables["against"] = [against.table()]
    sets[0].write(folder, tex)
    problems = [f"{a.name}: {text}" for a in sets for text in a.results.problems]
    about = {answers.name: _about(answers) for answers in sets}
    path = folder / "report.html"
    write_atomically(path, page.render(_sections(sets), problems, about, against))
    _show_table1(console, sets)
    if not brief:
        _show_all(console, against, about)
    print_problems(console, sets)
    page_file = last_line(_table1(sets[0]), os.path.relpath(path))
    console.print(Text(page_file), soft_wrap=True)
    return path


def _table1(answers: Answers) -> Table | None:
    tables = answers.tables.get("table1", [])
    return next((table for table in tables if table.name == "table1"), None)


def _show_table1(console: Console, sets: Sequence[Answers]) -> None:
    """One's own Table I with what lies outside the reference; the reference where there is none."""
    tables = [table for answers in sets if (table := _table1(answers)) is not None]
    if tables:
        show_table1(console, *tables[:2])


def _show_all(
    console: Console,
    against: Comparison | None,
    about: Mapping[str, str],
) -> None:
    """Every own number against the reference, and where the records are from."""
    for line in against.lines() if against is not None else ():
        style = "yellow" if line.startswith("!") else ""
        console.print(Text(printable(line), style), soft_wrap=True)
    for name, text in about.items():
        console.print(Text(printable(f"{name}: {text}"), "dim"), soft_wrap=True)


def _against(sets: Sequence[Answers]) -> Comparison | None:
    """Own results against the reference; None unless both are there."""
    if len(sets) < 2:
        return None
    mine, reference = (list(answers.every_table()) for answers in sets)
    return compare(mine, reference)


def _sections(sets: Sequence[Answers]) -> list[Section]:
    """The parts of the page, of one's own results where there are any: what lies outside the
    reference, a study each, every published number, and the runs."""
    shown = sets[0]
    sections = []
    for study in shown.questions:
        failures = [
            line for answers in sets for line in answers.failures_of(study.name)
        ]
        tables, pictures = shown.tables[study.name], shown.pictures[study.name]
        is_asked = bool(tables or pictures or failures)
        if is_asked or shown.name == "reference":
            section = Section(
                study.name,
                study.title,
                study.question,
                tables,
                pictures,
                study.front,
                failures,
            )
            sections.append(section)
    compared = shown.tables["comparison"]
    if compared:
        sections.append(Section("comparison", "Every published number", "", compared))
    if "against" in shown.tables:
        against = shown.tables["against"]
        sections.append(Section("against", "Own against reference", "", against))
    if shown.name == "mine" and len(shown.results.runs) <= MOST_RUNS:
        sections.append(Section("runs", "Every run", "", shown.tables["runs"]))
    return sections


def _about(answers: Answers) -> str:
    """How many records there are, of which code, from which machine."""
    results = answers.results
    records: list[Run | Measured] = [*results.runs, *results.measurements]
    machines = set()
    for entry in records:
        environment = entry.record.environment
        machines.add((environment.cpu, environment.threads))
    where = "; ".join(
        f"{cpu}, {counted(threads, 'thread')}" for cpu, threads in sorted(machines)
    )
    counts = f"{len(results.runs)} runs and {len(results.measurements)} measurements on {where}"
    counts += f" ({'tables/runs.csv' if answers.name == 'mine' else 'runs.jsonl'} has every run)"
    old = [record for record in records if record.outdated]
    if not old:
        return f"{counts}, all by this code"
    parts = sorted({name for record in old for name in record.outdated})
    counts += (
        f"; {len(old)} by other revisions, {len(parts)} changed since: {parts[0]} …"
    )
    tables = answers.older_tables()
    return (
        f"{counts}; tables of older revisions: {', '.join(tables)}"
        if tables
        else counts
    )


def _drawn(
    plot: Plot,
    folder: Path | None,
) -> bytes:
    from experiments.reporting.plot import save  # --help does not wait for matplotlib

    file = folder and folder / f"{plot.name}.{plot.kind}"
    if file and file.exists():
        return file.read_bytes()
    return save(plot.draw(), plot.kind)


def print_problems(console: Console, sets: Sequence[Answers]) -> None:
    """A line for each record that was left out and each study that failed."""
    for answers in sets:
        for problem in answers.results.problems:
            text = f"left out of {answers.name}: {printable(problem)}"
            console.print(
                escape(text),
                style="yellow",
                soft_wrap=True,
                emoji=False,
            )
        for failure in answers.failures:
            text = f"{answers.name}: {printable(str(failure))}"
            console.print(
                escape(text),
                style="red",
                soft_wrap=True,
                emoji=False,
            )


if __name__ == "__main__":
    main()
