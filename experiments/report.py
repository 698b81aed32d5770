"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads own results and the committed reference, never trains, and writes ``tables/``, ``figures/``
and ``report.html`` into the folder of own results: paper, reference and mine side by side. What is
wrong with a record is said, and costs that record only. ``--reference`` makes the committed tables
and figures again from the committed records, for maintainers.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table as TerminalTable
from rich.text import Text

from experiments import studies
from experiments.records import configs
from experiments.records.files import REFERENCE, results_dir, write_atomically
from experiments.records.measurement import Measured
from experiments.records.results import Results, Run
from experiments.reporting import comparison
from experiments.reporting.page import page
from experiments.reporting.page.page import Block, Picture, Section
from experiments.reporting.rows import EARLY, STAR
from experiments.reporting.runs import runs_table
from experiments.reporting.study import Plot, Quantity, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table, beside, printable
from experiments.reporting.terminal import in_any_encoding

STANDS = REFERENCE / "stands.yaml"
WIDTH = 100  # columns of the terminal that Table I needs
_NAMED = 3  # files of changed code that are named
# What rows raise that other code made, or an editor: they lack a key, or count no samples.
_OF_RECORDS = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, OSError)


@dataclass
class Answers:
    """What one set of results says to every study.

    Args:
        name: ``reference`` or ``mine``.
        results: the records.
        questions: the studies.
    """

    name: str
    results: Results
    questions: Sequence[Study]
    tables: dict[str, list[Table]] = field(default_factory=dict)
    plots: dict[str, list[Plot]] = field(default_factory=dict)
    pictures: dict[str, list[Picture]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        quantities: list[Quantity] = []
        for study in self.questions:
            self.tables[study.name] = list(self._tried(study.name, study.tables))
            self.plots[study.name] = list(self._tried(study.name, study.plots))
            quantities += self._tried(study.name, study.quantities)
        self.tables["comparison"] = [comparison.compare(quantities)]
        self.tables["runs"] = [runs_table(self.results)]

    def draw(self, drawn: Path | None = None) -> None:
        """Draw every figure, or take it from a folder where it was drawn before."""
        for study, plots in self.plots.items():
            self.pictures[study] = []
            for plot in plots:
                data = None
                if drawn is not None:
                    with suppress(FileNotFoundError):
                        data = (drawn / f"{plot.name}.{plot.kind}").read_bytes()
                with self._costing_itself_only(plot.name):
                    self.pictures[study].append(Picture(plot, data or _drawn(plot)))

    def write(self, folder: Path) -> list[Path]:
        """Write tables and figures as files, and remove those of an earlier report; the files."""
        texts = {}
        for table in (table for tables in self.tables.values() for table in tables):
            if table.name == "runs" and self.name == "reference":
                continue  # the archive itself
            texts[f"tables/{table.name}.csv"] = table.csv()
            if table.name != "runs":
                texts[f"tables/{table.name}.md"] = table.markdown()
            if table.name == "table1":
                texts[f"tables/{table.name}.tex"] = table.latex()
        for name, text in texts.items():
            write_atomically(folder / name, text)
        written = [folder / name for name in texts]
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for picture in (picture for same in self.pictures.values() for picture in same):
            written.append(folder / "figures" / f"{picture.plot.name}.{picture.plot.kind}")
            written[-1].write_bytes(picture.data)
        made = {path for name in ("tables", "figures") for path in (folder / name).iterdir()}
        for path in made.difference(written):
            path.unlink()
        return written

    def _tried(self, name: str, make: Callable[[Results], Iterable[Any]]) -> Iterator[Any]:
        with self._costing_itself_only(name):
            yield from make(self.results)

    @contextmanager
    def _costing_itself_only(self, name: str) -> Iterator[None]:
        """What rows of other code lack, or an editor put there, is named, and the rest stands."""
        try:
            yield
        except _OF_RECORDS as error:
            self.results.problems.append(f"{name}: {type(error).__name__}: {error}")


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I."""
    parser = argparse.ArgumentParser(prog="python -m experiments.report", description=__doc__)
    parser.add_argument("--device", default="cpu", help="use runs of this device (cpu)")
    parser.add_argument(
        "--reference", action="store_true", help="write the tables and figures of the reference"
    )
    chosen = parser.parse_args(arguments)
    in_any_encoding()
    console = Console(width=WIDTH, highlight=False)
    try:
        if chosen.reference:
            _write_reference(chosen.device, console)
        else:
            write(results_dir(), chosen.device, console)
    except (OSError, ValueError) as error:  # a disk that is full, published.csv that is not there
        sys.exit(f"error: {error}")


def _write_reference(device: str, console: Console) -> None:
    answers = Answers("reference", Results(REFERENCE, device), all_studies())
    answers.draw()
    written = answers.write(REFERENCE)
    _print_problems(console, [answers])
    console.print(f"{len(written)} files in {os.path.relpath(REFERENCE)}", soft_wrap=True)


def all_studies() -> list[Study]:
    """Every study, in the order of the page."""
    return studies_of(studies)


def write(folder: Path, device: str, console: Console) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file."""
    folder.mkdir(parents=True, exist_ok=True)  # what cannot be written is said before the work
    questions = all_studies()
    reference = Answers("reference", Results(REFERENCE, device), questions)
    mine = Answers("mine", Results(folder, device), questions)
    sets = [answers for answers in (mine, reference) if answers.results] or [mine]
    mine.draw()
    reference.draw(REFERENCE / "figures")
    (mine if mine.results else reference).write(folder)
    compared = _side_by_side(sets, "comparison")
    sections = [_section(study, sets) for study in questions]
    sections.insert(
        sum(study.front for study in questions),
        Section("comparison", "Every published number", "", [Block("", [compared])]),
    )
    if mine in sets:
        sections.append(Section("runs", "Every run", "", [Block("", mine.tables["runs"])]))
    problems = [f"{a.name}: {text}" for a in sets for text in a.results.problems]
    about = {answers.name: _about(answers) for answers in sets}
    path = folder / "report.html"
    write_atomically(path, page.render(sections, problems, about, configs.minutes()))
    console.print(terminal_table(sets))
    for name, text in about.items():
        console.print(Text(printable(f"{name}: {text}"), "dim"))
    _print_problems(console, sets)
    console.print(f"page: {os.path.relpath(path)}", soft_wrap=True)
    return path


def _section(study: Study, sets: Sequence[Answers]) -> Section:
    """A study's answers: one table where a key says what belongs together, else one after
    another."""
    joined = {"table1"} if len(sets) > 1 else set()
    there = joined & {table.name for a in sets for table in a.tables[study.name]}
    blocks = [Block("", [_side_by_side(sets, name)]) for name in sorted(there)]
    for answers in reversed(sets):  # what was measured whole stands before one's first looks
        tables = [table for table in answers.tables[study.name] if table.name not in joined]
        pictures = answers.pictures[study.name]
        if tables or pictures:
            blocks.append(Block(answers.name if len(sets) > 1 else "", tables, pictures))
    return Section(study.name, study.title, study.question, blocks, study.front)


def _side_by_side(sets: Sequence[Answers], name: str) -> Table:
    """The table of all sets of results that is called as its study is."""
    found = [table for a in sets for table in a.tables[name] if table.name == name]
    return found[0] if len(found) == 1 else beside(found[0], found[1])


def _about(answers: Answers) -> str:
    """How much there is, of which code, from which machine."""
    results = answers.results
    made: list[Run | Measured] = [*results.runs, *results.measurements]
    machines = {(r.environment.cpu, r.environment.threads) for r in (m.record for m in made)}
    where = "; ".join(f"{cpu}, {threads} threads" for cpu, threads in sorted(machines))
    counts = f"{len(results.runs)} runs and {len(results.measurements)} measurements on {where}"
    old = [one for one in made if not set(one.outdated) <= set(stands())]
    if not old:
        return f"{counts}, all by the code as it is, or that computes the same"
    files = sorted({name for one in old for name in one.outdated})
    more = f" and {len(files) - _NAMED} more" if len(files) > _NAMED else ""
    return (
        f"{counts}; {len(old)} by other code than this: {', '.join(files[:_NAMED])}{more} changed"
    )


def stands() -> dict[str, str]:
    """Files that have changed since committed records were made → why the records may stand."""
    found: Any = OmegaConf.load(STANDS) if STANDS.is_file() else {}
    return dict(found)


def _drawn(plot: Plot) -> bytes:
    from experiments.reporting.plot import save  # --help does not wait for matplotlib

    return save(plot.draw(), plot.kind)


def terminal_table(sets: Sequence[Answers]) -> TerminalTable:
    """Table I for the terminal: the paper's numbers beside each set of results."""
    (first, *_) = (a.tables["table1"][0] for a in sets)
    table = TerminalTable(
        title=Text(printable(first.title)),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    table.add_column("model")
    for head in ("training, s", "test, %"):
        for name in ("paper", *(answers.name for answers in sets)):
            table.add_column(
                f"{head}\n{name}" if name == "paper" else f"\n{name}", justify="right", no_wrap=True
            )
    rows = [{row["Model"]: row for row in _shown(a.tables["table1"][0])} for a in sets]
    for model, row in rows[0].items():
        # Quartiles are in the table.
        times = (r[model]["Training time, s"].partition(" (")[0] for r in rows)
        cells = [row["Training time, s, paper"], *times]
        cells += [row["Test accuracy, %, paper [95 %]"]]
        cells += (r[model]["Test accuracy, %, final [95 %]"] for r in rows)
        table.add_row(*(Text(printable(cell)) for cell in (model, *cells)))
        if any(cell.endswith(STAR) for cell in cells):
            table.caption, table.caption_justify = f"{STAR} {EARLY}", "left"
    return table


def _shown(table: Table) -> list[dict[str, str]]:
    return [dict(zip(table.heads, cells, strict=True)) for cells in table.cells()]


def _print_problems(console: Console, sets: Sequence[Answers]) -> None:
    """What was left out, and why."""
    for answers in sets:
        for problem in answers.results.problems:
            text = f"left out of {answers.name}: {printable(problem)}"
            console.print(escape(text), style="yellow", soft_wrap=True, emoji=False)


if __name__ == "__main__":
    main()
