"""Table I with one seed, in minutes: ``python -m experiments.table1``, which ``make table1`` calls.

Each run is that of ``python -m experiments.run experiment=table1 model=NAME``; what is finished is
found finished. Its row is shown when it ends, and at last the whole table, by the code of ``python
-m experiments.report``; a row that this command does not measure is that of the reference.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from omegaconf import OmegaConf
from rich.console import Console

from experiments import report, run
from experiments.protocol.sweep import span
from experiments.records.configs import CONFIGS
from experiments.records.files import results_dir
from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.terminal import show_row
from experiments.studies.table1.view import TABLE1

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
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
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

    What is left is said at the pace of the models before, where it is slower than that of
    configs/table1.yaml.
    """
    console.print(f"Table I: {promise()}")
    left, worst = seconds(), 0
    taken = expected = 0.0
    for number, model in enumerate(seconds()):
        # A quick machine, or a run found finished, does not promise that the others are quick.
        pace = max(1.0, taken / expected) if expected else 1.0
        text = f"{display_name(model)}; about {span(pace * sum(left.values()))} left"
        console.print(text, soft_wrap=True)
        start = time.perf_counter()
        status = _run(model)
        taken += time.perf_counter() - start
        expected += left.pop(model)
        if status > SIGNALLED:
            return status
        worst = max(worst, status)
        _show(console, model, heads=number == 0)
    return worst


def _run(model: str) -> int:
    """Train a model, or find it trained; its exit status."""
    # HDC by NumPy's median takes seconds, and stands in the note of the reference.
    sys.argv[1:] = ["experiment=table1", f"model={model}", "~beside.hdc_numpy"]
    try:
        run.entry_point()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def _show(console: Console, model: str, heads: bool) -> None:
    """The row of a model that has just been trained."""
    table = TABLE1.made(Results(results_dir()).frame(*TABLE1.experiments))
    if table is not None:
        show_row(console, table, model, heads)


if __name__ == "__main__":
    sys.exit(main())
