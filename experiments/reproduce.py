"""Everything again, or what one claim needs: ``python -m experiments.reproduce``.

``configs/reproduce.yaml`` lists the steps; results go to the folder of own results. A step
that is finished is not begun again, so that the same call resumes after an interruption; one that
fails is named at the end, and the others run all the same. Timed steps run first, each alone; then
the others, two at a time with one thread each. ``--list`` shows steps and claims with their times,
and runs none.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace

from rich.console import Console

from experiments.records import locks
from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.records.results import Results
from experiments.reporting.terminal import show
from experiments.reproduction import make
from experiments.reproduction.steps import Step, able, claims, cost_text, steps
from experiments.studies.claims.view import VERDICTS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the steps; 1 if one failed, 2 if none can begin, 130 after an interruption."""
    chosen = _parser().parse_args(arguments)
    console = Console(highlight=False)
    mode = "quick" if chosen.quick else "full"
    found = steps(mode, chosen.claim)
    _tell(found, console)
    if chosen.list:
        say(console, f"claims, for --claim NAME: {', '.join(claims())}")
        return 0
    if not able(found):
        reasons = "; ".join(dict.fromkeys(step.skipped for step in found))
        text = f"error: nothing is measured: {reasons or f'no step is {mode}'}"
        say(console, f"{text}; python -m scenes.measured says how to get public data")
        return 2
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        status = make.run(found, mode, results_dir(), console)
    except locks.Held as error:
        say(console, str(error), "yellow")
        return locks.LEFT
    if chosen.claim is not None and status < 128:
        _show_verdicts(chosen.claim, console)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.reproduce", description=__doc__
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer seeds, without the long steps"
    )
    parser.add_argument(
        "--claim",
        metavar="NAME",
        choices=claims(),
        help="what one claim needs, and its verdicts by rules 4",
    )
    parser.add_argument(
        "--list", action="store_true", help="show steps and claims, run none"
    )
    return parser


def _tell(found: Sequence[Step], console: Console) -> None:
    """Which steps there are and how long they take."""
    here = able(found)
    say(
        console,
        f"{len(here)} of {len(found)} steps can run here, "
        f"about {cost_text(here)} from nothing on 2 cores",
    )
    for step in found:
        say(console, f"{step.name}, {step.minutes} min: {step.skipped or step.command}")


def _show_verdicts(claim: str, console: Console) -> None:
    """The verdicts of a claim by rules 4 on own records."""
    made = VERDICTS.made(Results(results_dir()).frame(*VERDICTS.experiments))
    if made is not None:
        show(console, replace(made, data=made.data[made.data.claim == claim]))


if __name__ == "__main__":
    sys.exit(main())
