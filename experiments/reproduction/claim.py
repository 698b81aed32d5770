"""Lines of ``--claim NAME`` after the steps of a claim: its words and its verdicts."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console

from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.records.results import Results
from experiments.reporting.columns import Row, scene_name
from experiments.reporting.table import records
from experiments.studies.claims import view
from experiments.studies.claims.history import history


def show(name: str, console: Console) -> None:
    """Print what a claim says, its verdicts by rules 4 on own records, and the frozen ones with the
    rules and the code that judged.

    Raises:
        ValueError: there is no such claim.
    """
    for line in lines(name):
        say(console, line)


def lines(name: str) -> Iterator[str]:
    """The claim, its verdicts on own records, and those that are frozen."""
    own = view.verdicts(Results(results_dir()).frame(*view.VERDICTS.experiments))
    every = history()
    judged, frozen = (records(of[of.claim == name]) for of in (own, every))
    if not judged and not frozen:
        known = ", ".join(dict.fromkeys([*own.claim, *every.claim]))
        raise ValueError(f"claim: expected one of {known}, found {name}")
    first = (judged or frozen)[0]
    who = {"the paper": "the paper says"}.get(first["by"], "ours")
    yield f"{name}: {who}: {first['says']}"
    for row in judged:
        number = view.with_unit(row, "mean")
        yield f"rules 4, {view.size(row)}: {view.shown_word(row)}, {number}, on your records"
    for row in frozen:
        yield f"{_held_against(row)}: {view.word(row)}, {view.number(row)}"
    for row in {row["rules"]: row for row in frozen}.values():
        rules = f"rules {row['rules']} of {row['dated']}, digest {row['digest']}"
        yield f"{rules}: judged last by the code of commit {row['judged']}; frozen"


def _held_against(row: Row) -> str:
    """The baseline of a verdict, and its recording if it is of a single one."""
    against = f"against {view.rival_name(row['rival'])}" if row["rival"] else "verdict"
    return f"{against}, {scene_name(row['recording'])}" if row["recording"] else against
