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
from dataclasses import replace

from omegaconf import OmegaConf
from rich.console import Console

from experiments import report, run
from experiments.protocol.load import Retries
from experiments.records.configs import CONFIGS
from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.records.record import Record
from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.terminal import OF_TABLE1, show_rows
from experiments.studies.table1.view import TABLE1

AGAIN = 2  # times that a disturbed row is measured again
AGAIN_S = 60  # seconds that all of these may take
_ONE_SEED = ("scene=touch", "stop=quick", "seed.run=0")  # as the sweep of table1


def main() -> int:
    """Carry out the runs and show their table; the exit status of the runs."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.table1",
        description=f"Train the models of Table I with one seed, which takes {promise()}, and show "
        "the table. Other seeds and models: python -m experiments.run experiment=table1.",
    )
    parser.parse_args()
    console = Console(width=report.WIDTH, highlight=False)
    call, retries = run.CommandLine(), Retries(AGAIN, AGAIN_S)
    say(console, f"Table I: {promise()}")
    with run.ended_by_signals():
        for number, model in enumerate(seconds()):
            say(console, display_name(model))
            with call.shown():
                _measure(console, model, retries)
                made = TABLE1.made(Results(results_dir()).frame(*TABLE1.experiments))
                if made is not None:
                    row = replace(made, data=made.data[made.data.model == model])
                    show_rows(console, row, widths=OF_TABLE1, heads=number == 0)
        with call.shown():
            report.write(results_dir(), console, brief=True)
    return call.status


def seconds() -> dict[str, int]:
    """About how long each model takes from nothing on two quiet cores, in the order of training."""
    return dict(OmegaConf.load(CONFIGS / "table1.yaml").seconds)


def promise() -> str:
    """The time that the whole takes."""
    return f"about {math.ceil(sum(seconds().values()) / 60)} min on two quiet cores"


def _measure(console: Console, model: str, retries: Retries) -> None:
    """Train a model, and again if something disturbed it."""

    def train(attempt: int) -> Record:
        words = ["experiment=table1", f"model={model}"]
        return run.run(*words, *_ONE_SEED, *(["force=true"] if attempt else []))

    for record in retries.attempts(train, _disturbed, seconds()[model]):
        if _disturbed(record):
            say(console, f"{display_name(model)}: disturbed, {_disturbed(record)}")


def _disturbed(record: Record) -> str:
    """Why the times of a training do not count; empty if they do."""
    return record.results.get("load.disturbed") or ""


if __name__ == "__main__":
    sys.exit(main())
