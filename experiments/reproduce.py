"""Everything again, step by step: ``python -m experiments.reproduce``.

The steps are those of ``configs/reproduce.yaml``; results go to the folder of own results. Finished
work is skipped by the commands themselves, so that the same call resumes after an interruption. A
step that fails is named at the end, and the others run all the same. ``--list`` shows the steps and
runs none. ``reproduce.csv`` gets the time and the largest memory of each call of a step.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from experiments.records import configs
from experiments.records.files import ROOT, results_dir
from hdc.io import write_atomically

FILE = "reproduce.csv"
WHAT = {
    "full": "everything",
    "quick": "everything with fewer seeds, without the long steps",
    "table1": "Table I with one seed",
}


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        words: what stands after ``python -m``.
        minutes: about how long it takes from nothing on 2 cores.
        needs: an environment variable that names data of others, without which it is skipped.
    """

    name: str
    words: tuple[str, ...]
    minutes: float
    needs: str | None = None

    @property
    def command(self) -> str:
        return shlex.join(["python", "-m", *self.words])

    @property
    def skipped(self) -> str:
        """Why it cannot run here, in a sentence; empty if it can."""
        if self.needs is None or os.environ.get(self.needs):
            return ""
        return f"skipped: the environment variable {self.needs} names no copy of public data"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the steps; 1 if one failed, 130 after an interruption."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.reproduce", description=__doc__
    )
    which = parser.add_mutually_exclusive_group()
    for mode in ("quick", "table1"):
        flag: Any = {
            "dest": "mode",
            "action": "store_const",
            "const": mode,
            "help": WHAT[mode],
        }
        which.add_argument(f"--{mode}", default="full", **flag)
    parser.add_argument("--list", action="store_true", help="show the steps, run none")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    found = steps(chosen.mode)
    total = span(60 * sum(step.minutes for step in found))
    console.print(
        f"{chosen.mode}: {WHAT[chosen.mode]}; about {total} from nothing on 2 cores"
    )
    for step in found:
        about = (
            f"{step.name}, {span(60 * step.minutes)}: {step.skipped or step.command}"
        )
        console.print(about, markup=False, soft_wrap=True)
    if chosen.list:
        return 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    return run(found, chosen.mode, results_dir(), console)


def steps(mode: str = "full") -> list[Step]:
    """The steps of one of :data:`WHAT`."""
    return [
        Step(s["name"], tuple(shlex.split(s[mode])), s["minutes"][mode], s.get("needs"))
        for s in configs.reproduction()
        if mode in s
    ]


def run(found: Sequence[Step], mode: str, results: Path, console: Console) -> int:
    """Run steps one after another; the exit status."""
    failed: list[str] = []
    left = 60 * sum(step.minutes for step in found)
    try:
        for k, step in enumerate(found, 1):
            console.rule(
                f"{k} of {len(found)}: {step.name}; {span(left)} left", align="left"
            )
            left -= 60 * step.minutes
            if step.skipped:
                console.print(f"[yellow]{step.name}: {step.skipped}[/yellow]")
                continue
            status = measured(step, mode, results)
            failed += [f"{step.name}: {status}"] if status != "finished" else []
    except KeyboardInterrupt:
        console.print("interrupted; the same command resumes")
        return 128 + signal.SIGINT
    for line in failed:
        console.print(f"[red]failed:[/red] {line}")
    return 1 if failed else 0


def measured(step: Step, mode: str, results: Path) -> str:
    """Run a step, note its time and the memory of its largest process; its status."""
    sys.stdout.flush()  # what stands above is told first
    start, peak, status = time.perf_counter(), 0, "interrupted"
    process = subprocess.Popen([sys.executable, "-m", *step.words], cwd=ROOT)
    try:
        _, ended, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
        peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        status = (
            f"failed with {process.returncode}" if process.returncode else "finished"
        )
    except BaseException as error:
        if not isinstance(error, KeyboardInterrupt):  # which it got as well
            process.terminate()
        process.wait()
        raise
    finally:
        row = {"step": step.name, "mode": mode, "command": step.command}
        seconds = time.perf_counter() - start
        note(results, {**row, "seconds": seconds, "peak_bytes": peak, "status": status})
    return status


def note(results: Path, row: dict[str, Any]) -> None:
    """Put a step's row into reproduce.csv: seconds of interrupted calls add up; of several whole
    ones the longest counts, as the others found work done."""
    rows = read(results)
    known = rows.get((row["step"], row["mode"]))
    if known and known["command"] == row["command"]:
        pair = float(known["seconds"]), row["seconds"]
        row["seconds"] = sum(pair) if known["status"] == "interrupted" else max(pair)
        row["peak_bytes"] = max(row["peak_bytes"], int(known["peak_bytes"]))
    rows[row["step"], row["mode"]] = row
    write(results, rows.values())


def write(results: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write reproduce.csv."""
    text = pd.DataFrame(list(rows)).to_csv(index=False, lineterminator="\n")
    write_atomically(results / FILE, text)


def read(results: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """Rows of reproduce.csv by step and mode."""
    path = results / FILE
    if not path.is_file():
        return {}
    rows = pd.read_csv(path).to_dict("records")
    return {(row["step"], row["mode"]): row for row in rows}


def span(seconds: float) -> str:
    """A length of time as one would say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"


if __name__ == "__main__":
    sys.exit(main())
