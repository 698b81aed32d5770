"""Everything again, or what one claim needs: ``python -m experiments.reproduce``.

``configs/reproduce.yaml`` lists the steps; results go to the folder of own results. A step
that is finished is not begun again, so that the same call resumes after an interruption; one that
fails is named at the end, and the others run all the same. Timed steps run first, each alone; then
the others, two at a time with one thread each. ``--list`` shows steps and claims with their times,
and runs none.
"""

from __future__ import annotations

import argparse
import difflib
import signal
import sys
from collections.abc import Sequence

from rich.console import Console

from experiments.protocol.sweep import span
from experiments.records import locks
from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.reproduction import claim, make
from experiments.reproduction.steps import (
    WHAT,
    Step,
    able,
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
        say(console, f"error: {error}")
        return 2
    mode = chosen.mode or "full"
    _tell(found, mode, chosen.claim, console)
    if chosen.list:
        if chosen.claim is None:
            _tell_claims(console)
        return 0
    if not able(found):
        reasons = "; ".join(dict.fromkeys(step.skipped for step in found))
        text = f"error: nothing is measured: every step is {reasons}"
        how = "python -m scenes.measured says how to get it"
        say(console, f"{text}; {how}")
        return 2
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    results = results_dir()
    try:
        status = make.run(found, mode, results, console)
    except locks.Held as error:
        say(console, str(error), "yellow")
        return locks.LEFT
    if chosen.claim is not None and status < 128:
        claim.show(chosen.claim, console)
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
        "--list", action="store_true", help="show steps and claims, run none"
    )
    return parser


def _steps(chosen: argparse.Namespace) -> list[Step]:
    """The steps that the command line asks for.

    Raises:
        ValueError: for a claim or a step that there is not, for a claim that has no such steps, or
            takes long and was not asked for expressly.
    """
    mode, name = chosen.mode or "full", chosen.claim
    _check("--claim", [name] if name else [], claims())
    _check("--step", chosen.step or [], [step.name for step in steps()])
    found = steps(mode, name)
    if chosen.step:
        found = [step for step in found if step.name in chosen.step]
    if not found:
        asked = f"--claim {name}" if name else "--step"
        raise ValueError(f"{asked}: it has no step for --{mode}")
    if name is not None and chosen.mode is None and not chosen.list:
        _ask(name, found)
    return found


def _check(option: str, given: Sequence[str], known: Sequence[str]) -> None:
    """Raise a ValueError for a name that is none of those known; it has the nearest one."""
    for name in given:
        if name not in known:
            text = f"{option}: expected one of {', '.join(known)}, found {name}"
            near = difflib.get_close_matches(name, known, 1)
            raise ValueError(f"{text}; did you mean {near[0]}?" if near else text)


def _ask(name: str, found: Sequence[Step]) -> None:
    """Refuse what takes long, unless it was asked for expressly."""
    if cost(able(found)) <= ASKS:
        return
    text = f"--claim {name} takes about {cost_text(able(found))}: add --full"
    quick = able(steps("quick", name))
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
    text = f"{mode}: {what}; about {cost_text(able(found))} from nothing on 2 cores"
    n_skipped = len(found) - len(able(found))
    if n_skipped:
        text += f"; {n_skipped} of {len(found)} steps are skipped"
    say(console, text)
    for step in found:
        time = span(60 * step.minutes)
        say(console, f"{step.name}, {time}: {step.skipped or step.command}")


def _tell_claims(console: Console) -> None:
    """Each claim with the time that it takes in full and quickly, or why it has no data here."""
    say(console, "claims, for --claim NAME:")
    for name in claims():
        every, quick = steps("full", name), able(steps("quick", name))
        full = able(every)
        text = f"{name}: {cost_text(full) if full else every[0].skipped}"
        if quick:
            text += f"; --quick {cost_text(quick)}"
        say(console, text)


if __name__ == "__main__":
    sys.exit(main())
