"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads own results and the committed reference, never trains, and writes ``tables/``, ``figures/``
and ``report.html`` into the folder of own results. With names of tables it shows these alone and
writes nothing. A record that cannot be used is named and skipped; a study that fails says so in its
own section, and the others are made. Records name code and run none of it: a study of your own
module is shown with ``--study MODULE``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
from rich.console import Console

from experiments import studies
from experiments.records import configs
from experiments.records.console import say
from experiments.records.files import REFERENCE, results_dir
from experiments.records.results import Results
from experiments.reporting import compare, page
from experiments.reporting.answers import MINE, OF_NO_STUDY, Answers
from experiments.reporting.page import Part, Section
from experiments.reporting.study import Study, own_study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.terminal import (
    last_line,
    show,
    show_scenes,
    show_table1,
)
from experiments.reporting.text import counted
from hdc.io import write_atomically

WIDTH = 100  # columns of the terminal that Table I needs
TITLES = {MINE: "Your results", "reference": "Reference results"}


@dataclass(frozen=True)
class Selection:
    """The studies and rows of a report.

    Attributes:
        own: studies of the user.
        only: by column, the names of the models and scenes whose rows tables keep; all of them
            where there is none.
        mine: without the reference.
    """

    own: Sequence[Study] = ()
    only: Mapping[str, Sequence[str]] = field(default_factory=dict)
    mine: bool = False


EVERYTHING = Selection()


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I once, and own numbers against the reference."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.report", description=__doc__
    )
    parser.add_argument(
        "tables", nargs="*", metavar="TABLE", help="show these tables, write nothing"
    )
    parser.add_argument(
        "--tex", action="store_true", help="write every table as LaTeX, too"
    )
    parser.add_argument(
        "--study",
        action="append",
        default=[],
        metavar="MODULE",
        help="show the STUDY of a module of your own, too; it is imported",
    )
    for name in ("model", "scene"):
        parser.add_argument(
            f"--{name}",
            action="append",
            default=[],
            metavar="NAME",
            help=f"rows of this {name} alone; may be repeated",
        )
    parser.add_argument(
        "--only-mine", action="store_true", help="own results without the reference"
    )
    chosen = parser.parse_args(arguments)
    console = Console(width=WIDTH, highlight=False)
    try:
        own = list(map(own_study, chosen.study))
        scenes = dict.fromkeys(("scene", "recording"), chosen.scene)
        only = {"model": chosen.model, **scenes}
        selection = Selection(own, only, chosen.only_mine)
        if chosen.tables:
            show_tables(chosen.tables, results_dir(), console, selection)
        else:
            write(results_dir(), console, tex=chosen.tex, selection=selection)
    except (OSError, ValueError) as error:  # a full disk, a missing published.csv
        sys.exit(f"error: {error}")


def show_tables(
    names: Iterable[str],
    folder: Path,
    console: Console,
    selection: Selection = EVERYTHING,
) -> None:
    """Show tables of own results, and of the reference where own results have none.

    Raises:
        ValueError: no study has a table of this name.
    """
    sets = _sets(folder, selection)
    of_studies = (study.tables for study in sets[0].studies)
    known = [*(t.name for tables in of_studies for t in tables), *OF_NO_STUDY]
    for name in names:
        if name not in known:
            raise ValueError(f"expected one of {', '.join(known)}, found {name}")
        with _displays(sets):
            found = ((answers.name, answers.table(name)) for answers in sets)
            of, table = next((each for each in found if each[1]), ("", None))
            if table is None:
                say(console, f"{name}: not measured yet", "yellow")
            else:
                say(console, TITLES[of], "bold")
                show(console, table)
    print_problems(console, sets)


def _sets(folder: Path, selection: Selection) -> list[Answers]:
    """Own results and the reference, as far as they hold anything; one's own where neither does."""
    folder.mkdir(parents=True, exist_ok=True)  # one that cannot be written fails first
    questions = [*studies_of(studies), *selection.own]
    mine = Answers(MINE, Results(folder), questions, selection.only)
    if selection.mine:
        return [mine]
    reference = Answers("reference", Results(REFERENCE), questions, selection.only)
    return [answers for answers in (mine, reference) if answers.results] or [mine]


def _displays(sets: Sequence[Answers]) -> AbstractContextManager[None]:
    """Show models and scenes as their records say; own records take precedence."""
    every = [answers.results.displays for answers in reversed(sets)]
    return configs.shown_as({key: shown for of in every for key, shown in of.items()})


def write(
    folder: Path,
    console: Console,
    tex: bool = False,
    brief: bool = False,
    selection: Selection = EVERYTHING,
) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file.

    Args:
        folder: of own results.
        console: gets Table I, own models by scene, own numbers beside the reference, where the
            records are from, and what was left out.
        tex: write tables as LaTeX, too.
        brief: show Table I, what of it differs from the reference, and what was left out.
        selection: what the report is of.
    """
    sets = _sets(folder, selection)
    first = sets[0]
    with _displays(sets):
        tables = [list(answers.every_table()) for answers in sets]
        numbers = compare.compare_all(tables[0], tables[1] if len(sets) > 1 else ())
        if first.name == MINE or tex:
            first.write(folder, tex)
        path = folder / "report.html"
        problems = [f"{a.name}: {text}" for a in sets for text in a.left_out]
        parts = list(_parts(sets, folder))
        write_atomically(path, page.render(parts, compare.differing(numbers), problems))
        _show(console, sets, numbers, brief)
    print_problems(console, sets)
    table1 = first.table("table1") if first.name == MINE else None
    say(console, last_line(table1, os.path.relpath(path)))
    return path


def _show(
    console: Console, sets: Sequence[Answers], numbers: pd.DataFrame, brief: bool
) -> None:
    """Table I, and what stands beside it: :func:`write` says what is brief."""
    first, *others = (answers.table("table1") for answers in sets)
    if first is not None:
        show_table1(console, first, *filter(None, others))
    if brief:
        differing = compare.differing(numbers)
        for sentence in differing.sentence[differing.table == "table1"]:
            say(console, sentence, "yellow")
        return
    scenes = sets[0].table("all_scenes")
    if sets[0].name == MINE and scenes is not None:
        show_scenes(console, scenes)
    for line in compare.lines(numbers) if len(numbers) else ():
        say(console, line)
    for answers in sets:
        say(console, f"{answers.name}: {_about(answers.results)}", "dim")


def _parts(sets: Sequence[Answers], folder: Path) -> Iterator[Part]:
    """The sets of results on the page: of the reference what one's own do not have."""
    shown: set[str] = set()
    for answers in sets:
        sections = [
            s for s in _sections(answers, shown) if s.tables or s.figures or s.failures
        ]
        if not sections and shown:
            continue  # one's own have it all
        shown |= {table.name for section in sections for table in section.tables}
        shown |= {figure.name for section in sections for figure in section.figures}
        own = answers.name == MINE
        drawn = (REFERENCE / "figures").glob("*.svg") if own else ()
        yield Part(
            answers.name,
            TITLES[answers.name],
            _about(answers.results),
            os.path.relpath(folder if own else REFERENCE, folder),
            sections,
            unfolded=own or len(sets) == 1,
            of_reference={path.stem: os.path.relpath(path, folder) for path in drawn},
        )


def _sections(answers: Answers, shown: set[str]) -> Iterator[Section]:
    """Tables and figures of each study that were not shown before, and tables of no study."""
    for study in answers.studies:
        tables = [t for t in answers.tables(study) if t.name not in shown]
        figures = [f for f in answers.figures(study) if f.name not in shown]
        failures = [one.text for one in answers.failures if one.study == study.name]
        about = (study.name, study.title, study.question)
        yield Section(*about, tables, figures, failures)
    for table in answers.of_no_study:
        if table.name not in shown:
            yield Section(table.name, str(table.title), "", [table])


def _about(results: Results) -> str:
    """How many records there are, of which code, from which machine."""
    environments = [record.environment for record in results.finished]
    machines = {(env.cpu, env.threads) for env in environments}
    where = [f"{cpu}, {counted(n, 'thread')}" for cpu, n in sorted(machines)]
    runs = counted(len(results.runs), "run")
    counts = f"{runs} and {counted(len(results.measurements), 'measurement')}"
    if not where:
        return counts
    text = f"{counts} on {'; '.join(where)}"
    old = [record for record in results.finished if record.outdated]
    if not old:
        return f"{text}, all by this code"
    changed = sorted({name for record in old for name in record.outdated})
    parts = counted(len(changed), "part")
    return f"{text}; {len(old)} by other versions of {parts}, first {changed[0]}"


def print_problems(console: Console, sets: Sequence[Answers]) -> None:
    """A line for each record that was left out and each study that failed."""
    for answers in sets:
        for text in answers.left_out:
            say(console, f"left out of {answers.name}: {text}", "yellow")
        for failure in answers.failures:
            say(console, f"{answers.name}: {failure}", "red")


if __name__ == "__main__":
    main()
