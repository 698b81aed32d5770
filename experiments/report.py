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
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import pandas as pd
from rich.console import Console

from experiments import studies
from experiments.records import configs
from experiments.records.console import say
from experiments.records.files import REFERENCE, results_dir
from experiments.records.results import Results
from experiments.reporting import compare, page
from experiments.reporting.answers import MINE, Answers
from experiments.reporting.study import Study, own_study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.terminal import OF_TABLE1, show
from experiments.reporting.text import counted
from hdc.io import write_atomically

WIDTH = 100  # columns of the terminal that Table I needs
TITLES = {MINE: "Your results", "reference": "Reference results"}
OF_SCENES = ("scene", "model", "seeds", "test_accuracy_final", "training_time_s")
MOST_ROWS = 20  # of own models by scene


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
    folder = results_dir()
    scenes = dict.fromkeys(("scene", "recording"), chosen.scene)
    try:
        own = list(map(own_study, chosen.study))
        only = {"model": chosen.model, **scenes}
        sets = sets_of(folder, own, only, chosen.only_mine)
        if chosen.tables:
            show_tables(chosen.tables, sets, console)
        else:
            write(folder, console, sets, tex=chosen.tex)
    except (OSError, ValueError) as error:  # a full disk, a missing published.csv
        sys.exit(f"error: {error}")


def sets_of(
    folder: Path,
    own: Sequence[Study] = (),
    only: Mapping[str, Sequence[str]] | None = None,
    mine: bool = False,
) -> list[Answers]:
    """Own results and the reference, as far as they hold anything; one's own where neither does.

    Args:
        folder: of own results.
        own: studies of the user.
        only: by column, the names of the models and scenes whose rows tables keep.
        mine: without the reference.
    """
    folder.mkdir(parents=True, exist_ok=True)  # one that cannot be written fails first
    questions = [*studies_of(studies), *own]
    sets = [Answers(MINE, Results(folder), questions, only or {})]
    if not mine:
        sets.append(Answers("reference", Results(REFERENCE), questions, only or {}))
    return [answers for answers in sets if answers.results] or sets[:1]


def show_tables(
    names: Iterable[str], sets: Sequence[Answers], console: Console
) -> None:
    """Show tables of own results, and of the reference where own results have none.

    Raises:
        ValueError: no study has a table of this name.
    """
    every = [study for answers in sets for study in answers.every_study]
    known = dict.fromkeys(table.name for study in every for table in study.tables)
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


def _displays(sets: Sequence[Answers]) -> AbstractContextManager[None]:
    """Show models and scenes as their records say; own records take precedence."""
    every = [answers.results.displays for answers in reversed(sets)]
    return configs.shown_as({key: shown for of in every for key, shown in of.items()})


def write(
    folder: Path,
    console: Console,
    sets: Sequence[Answers] = (),
    tex: bool = False,
    brief: bool = False,
) -> Path:
    """Write tables, figures and the page into a folder of own results; the page's file.

    Args:
        folder: of own results.
        console: gets Table I, own models by scene, own numbers beside the reference, where the
            records are from, and what was left out.
        sets: of results, of :func:`sets_of`; own results and the reference, if empty.
        tex: write tables as LaTeX, too.
        brief: show Table I, what of it differs from the reference, and what was left out.
    """
    sets = sets or sets_of(folder)
    first, *others = sets
    path = folder / "report.html"
    with _displays(sets):
        reference = [table for each in others for table in each.every_table()]
        numbers = compare.compare(first.every_table(), reference)
        if first.name == MINE or tex:
            first.write(folder, tex)
        write_atomically(path, _page(folder, sets, numbers))
        _show(console, first, numbers, brief)
    if not brief:
        for answers in sets:
            say(console, f"{answers.name}: {_about(answers.results)}", "dim")
    print_problems(console, sets)
    say(console, f"page: {os.path.relpath(path)}")
    return path


def _page(folder: Path, sets: Sequence[Answers], numbers: pd.DataFrame) -> str:
    """The page, with numbers of one's own that differ from the reference."""
    heads = []
    for answers in sets:
        place = folder if answers.name == MINE else REFERENCE
        about = _about(answers.results), os.path.relpath(place, folder)
        heads.append((TITLES[answers.name], *about))
    problems = [f"{a.name}: {text}" for a in sets for text in a.left_out]
    differing = numbers[numbers.differs].to_dict("records")
    return page.render(sets, heads, differing, problems)


def _show(
    console: Console, answers: Answers, numbers: pd.DataFrame, brief: bool
) -> None:
    """Table I, and what stands beside it: :func:`write` says what is brief."""
    table1, scenes = answers.table("table1"), answers.table("all_scenes")
    if table1 is not None:
        show(console, table1, widths=OF_TABLE1)
    if brief:
        for sentence in numbers.sentence[numbers.differs & (numbers.table == "table1")]:
            say(console, sentence, "yellow")
        return
    if answers.name == MINE and scenes is not None:
        show(console, replace(scenes, shown=OF_SCENES), MOST_ROWS)
    for line in compare.lines(numbers) if len(numbers) else ():
        say(console, line)


def _about(results: Results) -> str:
    """How many records there are, and from which machine."""
    environments = [record.environment for record in results.finished]
    machines = {(env.cpu, env.threads) for env in environments}
    where = [f"{cpu}, {counted(n, 'thread')}" for cpu, n in sorted(machines)]
    runs = counted(len(results.runs), "run")
    counts = f"{runs} and {counted(len(results.measurements), 'measurement')}"
    return f"{counts} on {'; '.join(where)}" if where else counts


def print_problems(console: Console, sets: Sequence[Answers]) -> None:
    """A line for each record that was left out and each study that failed."""
    for answers in sets:
        for text in answers.left_out:
            say(console, f"left out of {answers.name}: {text}", "yellow")
        for _, text in answers.failures:
            say(console, f"{answers.name}: {text}", "red")


if __name__ == "__main__":
    main()
