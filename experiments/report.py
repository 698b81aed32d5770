"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads own results and the committed reference, never trains, and writes ``tables/``, ``figures/``
and ``report.html`` into the folder of own results. A record that cannot be used is named and
skipped; a study that fails says so in its own section, and the others are made.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.text import Text

from experiments import studies
from experiments.records.files import REFERENCE, results_dir
from experiments.records.results import RUNS, Results
from experiments.reporting import against, comparison, page
from experiments.reporting.against import Cell
from experiments.reporting.page import Part, Section
from experiments.reporting.rows import runs_table
from experiments.reporting.study import Failure, Plot, Quantity, Study, own_studies
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table, experiments_of
from experiments.reporting.terminal import last_line, show_scenes, show_table1
from experiments.reporting.text import counted, printable
from hdc.io import write_atomically

WIDTH = 100  # columns of the terminal that Table I needs
MINE = "mine"
TITLES = {MINE: "Your results", "reference": "Reference results"}


@dataclass
class Answers:
    """Tables and figures of every study for one set of results, ``reference`` or ``mine``.

    What fails is kept in ``failures`` by the name of its study; everything else is made.
    """

    name: str
    results: Results
    questions: Sequence[Study]
    tables: dict[str, list[Table]] = field(default_factory=dict)
    plots: dict[str, list[Plot]] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)

    def __post_init__(self) -> None:
        quantities: list[Quantity] = []
        experiments: list[str] = []
        for study in self.questions:
            of_study = self.results, self.failures
            self.tables[study.name] = list(study.tables_of(*of_study))
            self.plots[study.name] = list(study.plots_of(*of_study))
            quantities += study.quantities_of(*of_study)
            for numbers in study.numbers:
                experiments += experiments_of(numbers.of)
        # Among one's own stands nothing that was not measured.
        every = comparison.compare(quantities, experiments, self.name != MINE)
        self.tables["comparison"] = [every] if len(every.data) else []
        if self.name == MINE:  # records.jsonl has the runs of the reference
            self.tables["runs"] = [runs_table(self.results)]

    def every_table(self) -> Iterator[Table]:
        """The tables of all studies, one after another."""
        return itertools.chain(*self.tables.values())

    def table(self, name: str) -> Table | None:
        """The table of that name."""
        return next((one for one in self.every_table() if one.name == name), None)

    def older_tables(self) -> list[str]:
        """Names of the tables that take an experiment with records of older code."""
        older = {one.name for one in self.results.measurements if one.outdated}
        if any(run.outdated for run in self.results.runs):
            older.add(RUNS)
        tables = self.every_table()
        found = (t.name for t in tables if not older.isdisjoint(experiments_of(t.of)))
        return sorted(found)

    def write(self, folder: Path, tex: bool = False) -> list[Path]:
        """Write tables and figures as files, and remove those of an earlier report; the files."""
        texts: dict[str, str] = {}
        for table in self.every_table():
            texts |= _texts_of(table, tex)
        for name, text in texts.items():
            write_atomically(folder / name, text)
        written = [folder / name for name in texts]
        written += self._draw(folder / "figures")
        for path in (*folder.glob("tables/*"), *folder.glob("figures/*")):
            if path.is_file() and path not in written:
                path.unlink()
        return written

    def _draw(self, folder: Path) -> Iterator[Path]:
        """Draw every figure; the files. One that fails is none."""
        # --help does not wait for matplotlib.
        from experiments.reporting.plot import save

        for study, plots in self.plots.items():
            for plot in tuple(plots):
                try:
                    drawn = save(plot.draw(), plot.kind)
                except Exception as error:
                    failure = Failure(study, f"figure {plot.name}", error)
                    self.failures.append(failure)
                    plots.remove(plot)
                else:
                    path = folder / f"{plot.name}.{plot.kind}"
                    write_atomically(path, drawn)
                    yield path


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I once, and own numbers against the reference."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.report", description=__doc__
    )
    parser.add_argument(
        "--tex", action="store_true", help="write every table as LaTeX, too"
    )
    chosen = parser.parse_args(arguments)
    console = Console(width=WIDTH, highlight=False)
    try:
        write(results_dir(), console, tex=chosen.tex)
    except (OSError, ValueError) as error:  # a full disk, a missing published.csv
        sys.exit(f"error: {error}")


def answers_of(folder: Path) -> list[Answers]:
    """Own results and the reference, as far as they hold anything; one's own where neither does."""
    folder.mkdir(parents=True, exist_ok=True)  # one that cannot be written fails first
    own = Results(folder)
    questions = [*studies_of(studies), *own_studies(own)]
    mine = Answers(MINE, own, questions)
    reference = Answers("reference", Results(REFERENCE), questions)
    return [answers for answers in (mine, reference) if answers.results] or [mine]


def write(
    folder: Path, console: Console, tex: bool = False, brief: bool = False
) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file.

    Args:
        folder: of own results.
        console: gets Table I, own models by scene, own numbers beside the reference, where the
            records are from, and what was left out.
        tex: write tables as LaTeX, too.
        brief: show Table I, what of it differs from the reference, and what was left out.
    """
    sets = answers_of(folder)
    first = sets[0]
    cells = against.compare(*(a.every_table() for a in sets)) if len(sets) > 1 else []
    if first.name == MINE or tex:
        first.write(folder, tex)
    path = folder / "report.html"
    problems = [f"{a.name}: {text}" for a in sets for text in a.results.problems]
    parts = list(_parts(sets, folder))
    write_atomically(path, page.render(parts, against.differing(cells), problems))
    _show(console, sets, cells, brief)
    print_problems(console, sets)
    own = first.table("table1") if first.name == MINE else None
    _say(console, [last_line(own, os.path.relpath(path))])
    return path


def _show(
    console: Console, sets: Sequence[Answers], cells: Sequence[Cell], brief: bool
) -> None:
    """Table I, and what stands beside it: :func:`write` says what is brief."""
    every = [t for t in (answers.table("table1") for answers in sets) if t is not None]
    if every:
        show_table1(console, *every)
    if brief:
        differing = against.differing(cells)
        of_table1 = [str(cell) for cell in differing if cell.table.name == "table1"]
        _say(console, of_table1, "yellow")
        return
    scenes = sets[0].table("all_scenes")
    if sets[0].name == MINE and scenes is not None:
        show_scenes(console, scenes)
    _say(console, against.lines(cells) if cells else ())
    _say(console, (f"{a.name}: {_about(a)}" for a in sets), "dim")


def _parts(sets: Sequence[Answers], folder: Path) -> Iterator[Part]:
    """The sets of results on the page: of the reference what one's own do not have."""
    shown: set[str] = set()
    for answers in sets:
        sections = list(_sections(answers, shown))
        if not sections and shown:
            continue  # one's own have it all
        for section in sections:
            shown |= {table.name for table in section.tables}
            shown |= {plot.name for plot in section.plots}
        own = answers.name == MINE
        drawn = (REFERENCE / "figures").glob("*") if own else ()
        files = folder if own else REFERENCE
        yield Part(
            answers.name,
            TITLES[answers.name],
            _about(answers),
            os.path.relpath(files, folder),
            sections,
            unfolded=own or len(sets) == 1,
            figures={path.stem: os.path.relpath(path, folder) for path in drawn},
        )


def _sections(answers: Answers, shown: set[str]) -> Iterator[Section]:
    """Tables and figures of each study besides those shown already, and those of no study."""
    asked = [
        *((study.name, study.title, study.question) for study in answers.questions),
        ("comparison", "Every published number", ""),
        ("runs", "Every run", ""),
    ]
    for name, title, question in asked:
        tables = [t for t in answers.tables.get(name, ()) if t.name not in shown]
        plots = [p for p in answers.plots.get(name, ()) if p.name not in shown]
        failures = [str(one) for one in answers.failures if one.study == name]
        if tables or plots or failures:
            yield Section(name, title, question, tables, plots, failures)


def _about(answers: Answers) -> str:
    """How many records there are, of which code, from which machine."""
    results = answers.results
    records = results.finished
    environments = [record.environment for record in records]
    machines = {(env.cpu, env.threads) for env in environments}
    where = [f"{cpu}, {counted(n, 'thread')}" for cpu, n in sorted(machines)]
    runs = counted(len(results.runs), "run")
    counts = f"{runs} and {counted(len(results.measurements), 'measurement')}"
    text = f"{counts} on {'; '.join(where)}"
    old = [record for record in records if record.outdated]
    if not old:
        return f"{text}, all by this code"
    changed = sorted({name for record in old for name in record.outdated})
    parts = counted(len(changed), "part")
    return f"{text}; {len(old)} by other versions of {parts}, first {changed[0]}"


def _texts_of(table: Table, tex: bool) -> dict[str, str]:
    """The files of a table by name, with what they contain."""
    texts = {"csv": table.csv()}
    if table.name != "runs":
        texts["md"] = table.markdown()
        texts |= {"tex": table.tex()} if tex else {}
    return {f"tables/{table.name}.{kind}": text for kind, text in texts.items()}


def print_problems(console: Console, sets: Sequence[Answers]) -> None:
    """A line for each record that was left out and each study that failed."""
    for answers in sets:
        name, problems = answers.name, answers.results.problems
        _say(console, (f"left out of {name}: {text}" for text in problems), "yellow")
        _say(console, (f"{name}: {failure}" for failure in answers.failures), "red")


def _say(console: Console, lines: Iterable[str], style: str = "") -> None:
    for line in lines:
        console.print(Text(printable(line), style), soft_wrap=True)


if __name__ == "__main__":
    main()
