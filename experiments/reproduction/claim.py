"""What ``--claim NAME`` says of a claim, after its steps: its words and its frozen verdicts."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.text import Text

from experiments.reporting.columns import Row, scene_name
from experiments.reporting.table import records
from experiments.reporting.text import printable
from experiments.studies.claims import view


def show(name: str, console: Console) -> None:
    """Print what a claim says and each verdict on it, with the rules and the code that judged.

    Raises:
        ValueError: history.csv has no such claim.
    """
    for line in lines(name):
        console.print(Text(printable(line)), soft_wrap=True)


def lines(name: str) -> Iterator[str]:
    """The claim, its verdicts, and what judges one's own records."""
    every = view.history()
    rows = records(every[every.claim == name])
    if not rows:
        known = ", ".join(every.claim.unique())
        raise ValueError(f"claim: expected one of {known}, found {name}")
    who = {"the paper": "the paper says"}.get(rows[0]["by"], "ours")
    yield f"{name}: {who}: {rows[0]['says']}"
    for row in rows:
        yield f"{_held_against(row)}: {view.word(row)}, {view.number(row)}"
    for row in {row["rules"]: row for row in rows}.values():
        rules = f"rules {row['rules']} of {row['dated']}, digest {row['digest']}"
        yield f"{rules}: judged last by the code of commit {row['judged']}"
    yield (
        "these verdicts are of the reference and frozen; rules 4 will judge the claim anew. Your "
        "numbers: python -m experiments.report"
    )


def _held_against(row: Row) -> str:
    """The rival of a verdict, and the recording of one that is of a single recording."""
    against = f"against {view.rival_name(row['rival'])}" if row["rival"] else "verdict"
    return f"{against}, {scene_name(row['recording'])}" if row["recording"] else against
