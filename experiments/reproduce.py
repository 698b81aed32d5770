"""Everything again, or what one claim needs: ``python -m experiments.reproduce``.

The steps are those of ``configs/reproduce.yaml``; results go to the folder of own results. Finished
work is skipped by the commands themselves, so that the same call resumes after an interruption. A
step that fails is named at the end, and the others run all the same. Steps that time nothing
(``timed: false``) run two at a time, with one thread each. ``--list`` shows steps and claims with
their times, and runs none. ``reproduce.csv`` gets the time of each step, its calls added up, and
its largest memory.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence

from rich.console import Console

from experiments.protocol.sweep import span
from experiments.records.files import REFERENCE, results_dir
from experiments.reproduction import calls, claim
from experiments.reproduction.adopt import go_on_from
from experiments.reproduction.steps import (
    WHAT,
    Step,
    claims,
    cost,
    cost_text,
    steps,
)

ASKS = 15  # minutes from which a claim asks for --full


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the steps; 1 if one failed, 2 if none can begin, 130 after an interruption."""
    chosen = _parser().parse_args(arguments)
    console = Console(highlight=False)
    try:
        found = _steps(chosen)
    except ValueError as error:
        console.print(f"error: {error}", markup=False, soft_wrap=True)
        return 2
    mode = chosen.mode or "full"
    _tell(found, mode, chosen.claim, console)
    if chosen.list:
        if chosen.claim is None:
            _tell_claims(console)
        return 0
    if all(step.skipped for step in found):
        reasons = "; ".join(dict.fromkeys(step.skipped for step in found))
        text = f"error: nothing is measured: every step is {reasons}"
        how = "python -m scenes.measured says how to get it"
        console.print(f"{text}; {how}", markup=False, soft_wrap=True)
        return 2
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    results = results_dir()
    if chosen.go_on:
        copied = go_on_from(REFERENCE, results)
        console.print(f"{copied} records of the reference taken into own results")
    status = calls.run(found, mode, results, console)
    if chosen.claim is not None and status < 128:
        claim.show(chosen.claim, results, console)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.reproduce", description=__doc__
    )
    which = parser.add_mutually_exclusive_group()
    for mode, text in WHAT.items():
        which.add_argument(
            f"--{mode}", dest="mode", action="store_const", const=mode, help=text
        )
    parser.add_argument(
        "--claim",
        metavar="NAME",
        help="what one claim needs, its rule and its numbers; one that takes longer "
        f"than {ASKS} minutes asks for --full or --quick",
    )
    parser.add_argument(
        "--step",
        metavar="NAME",
        action="append",
        help="this step alone; may be repeated",
    )
    parser.add_argument(
        "--continue",
        dest="go_on",
        action="store_true",
        help="go on from the committed reference: what the present code made of it counts as done",
    )
    parser.add_argument(
        "--list", action="store_true", help="show steps and claims, run none"
    )
    return parser


def _steps(chosen: argparse.Namespace) -> list[Step]:
    """The steps that the command line asks for.

    Raises:
        ValueError: for a claim that is unknown, has no such steps, or takes long and was not asked
            for expressly; for a step that is unknown.
    """
    mode, name = chosen.mode or "full", chosen.claim
    if name is not None and name not in claims():
        known = ", ".join(claims())
        raise ValueError(f"--claim: expected one of {known}, found {name}")
    found = steps(mode, name)
    if not found:
        raise ValueError(f"--claim {name}: it has no step for --{mode}")
    if chosen.step:
        found = _named(chosen.step, found)
    if name is not None and chosen.mode is None and not chosen.list:
        _ask(name, found)
    return found


def _named(names: Sequence[str], found: Sequence[Step]) -> list[Step]:
    """The steps with these names."""
    known = {step.name: step for step in found}
    for name in names:
        if name not in known:
            expected = ", ".join(known)
            raise ValueError(f"--step: expected one of {expected}; found {name}")
    return [step for step in found if step.name in names]


def _ask(name: str, found: Sequence[Step]) -> None:
    """Refuse what takes long, unless it was asked for expressly."""
    if cost(found) <= ASKS:
        return
    text = f"--claim {name} takes about {cost_text(found)}: add --full"
    quick = steps("quick", name)
    if quick:
        text += f", or --quick for fewer seeds in {cost_text(quick)}"
    raise ValueError(text)


def _tell(
    found: Sequence[Step],
    mode: str,
    name: str | None,
    console: Console,
) -> None:
    """Which steps there are and how long they take."""
    what = WHAT[mode] if name is None else f"what the claim {name} needs"
    text = f"{mode}: {what}; about {cost_text(found)} from nothing on 2 cores"
    console.print(text, markup=False, soft_wrap=True)
    for step in found:
        time = span(60 * step.minutes)
        about = f"{step.name}, {time}: {step.skipped or step.command}"
        console.print(about, markup=False, soft_wrap=True)


def _tell_claims(console: Console) -> None:
    """Each claim with the time that it takes in full and quickly."""
    console.print("claims, for --claim NAME:")
    for name in claims():
        full, quick = steps("full", name), steps("quick", name)
        text = f"{name}: {cost_text(full)}"
        if quick:
            text += f"; --quick {cost_text(quick)}"
        console.print(text, markup=False)


if __name__ == "__main__":
    sys.exit(main())
