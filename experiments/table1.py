"""Table I with one seed, in minutes: ``python -m experiments.table1``, which ``make table1`` calls.

Each run is that of ``python -m experiments.run experiment=table1 model=NAME``; what is finished is
found finished. A training that another process disturbed is repeated, for a minute in all; its row
is marked if it is still disturbed. A row is shown when its run ends, and the whole table at the
end, by the code of ``python -m experiments.report``.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from omegaconf import OmegaConf
from rich.console import Console

from experiments import report, run
from experiments.protocol.load import Retries
from experiments.protocol.sweep import span
from experiments.records.configs import CONFIGS
from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.table import Table
from experiments.reporting.terminal import show_row
from experiments.studies.table1.tables import DISTURBED
from experiments.studies.table1.view import TABLE1

AGAIN = 2  # times that a disturbed row is measured again
AGAIN_S = 60  # seconds that all of these may take
SIGNALLED = 128  # and the number of the signal: the status of a process that one ended


def main() -> int:
    """Carry out the runs and show their table; the exit status of the runs."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.table1",
        description=f"Train the models of Table I with one seed, which takes {promise()}, and show "
        "the table. Other seeds and models: python -m experiments.run experiment=table1.",
    )
    parser.parse_args()
    console = Console(width=report.WIDTH, highlight=False)
    try:
        status = _carry_out(console)
        if status < SIGNALLED:
            report.write(results_dir(), console, brief=True)
    except (OSError, ValueError) as error:  # a full disk, a damaged file
        say(console, f"error: {error}", "red")
        return 1
    return status


def seconds() -> dict[str, int]:
    """About how long each model takes from nothing on two quiet cores, in the order of training."""
    return dict(OmegaConf.load(CONFIGS / "table1.yaml").seconds)


def promise() -> str:
    """The time that the whole takes."""
    return f"about {math.ceil(sum(seconds().values()) / 60)} min on two quiet cores"


def _carry_out(console: Console) -> int:
    """Train the models one after another; the largest exit status, or that of a signal.

    The time left is computed at the pace of the models before, if these were slower than the
    seconds of configs/table1.yaml.
    """
    say(console, f"Table I: {promise()}")
    left, worst, retries = seconds(), 0, Retries(AGAIN, AGAIN_S)
    taken = expected = 0.0
    for number, model in enumerate(seconds()):
        # A quick machine, or a run found finished, does not promise that the others are quick.
        pace = max(1.0, taken / expected) if expected else 1.0
        text = f"{display_name(model)}; about {span(pace * sum(left.values()))} left"
        say(console, text)
        start = time.perf_counter()
        status = _measured(console, model, retries)
        taken += time.perf_counter() - start
        expected += left.pop(model)
        if status > SIGNALLED:
            return status
        worst = max(worst, status)
        _show(console, model, heads=number == 0)
    return worst


def _measured(console: Console, model: str, retries: Retries) -> int:
    """Train a model, and again if something disturbed it; the exit status of the last training."""

    def train(attempt: int) -> int:
        if attempt:
            text = f"{display_name(model)}: disturbed, {_disturbed(model)}; once more"
            say(console, text)
        return _run(model, *(["force=true"] if attempt else []))

    def reason(status: int) -> str:
        return "" if status else _disturbed(model)

    *_, status = retries.attempts(train, reason, seconds()[model])
    return status


def _disturbed(model: str) -> str:
    """Why the times of a model that has been trained do not count; empty if they do."""
    table = _table()
    if table is None or DISTURBED not in table.data:
        return ""
    found = table.data[table.data.model == model][DISTURBED].dropna()
    return "".join(found)


def _run(model: str, *words: str) -> int:
    """Train a model, or find it trained; its exit status."""
    # HDC by NumPy's median takes seconds, and stands in the note of the reference.
    about = ["experiment=table1", f"model={model}", "~beside.hdc_numpy"]
    sys.argv[1:] = [*about, *words]
    try:
        run.entry_point(brief=True)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def _show(console: Console, model: str, heads: bool) -> None:
    """The row of a model that has just been trained."""
    table = _table()
    if table is not None:
        show_row(console, table, model, heads)


def _table() -> Table | None:
    """Table I as far as it has been measured."""
    return TABLE1.made(Results(results_dir()).frame(*TABLE1.experiments))


if __name__ == "__main__":
    sys.exit(main())
