"""Everything that lies in results/, step by step: ``python -m experiments.reproduce [--quick]``.

A step is a command. What is finished is skipped by the commands themselves, so the same call goes
on after an interruption; a step that fails is told at the end, and the others run all the same.
The report is made anew after each stage. ``--quick`` takes fewer seeds, stops the convolutional
networks at 90 % and leaves out what takes long; ``--list`` shows the steps and runs none.

tables/reproduce.csv has the longest time and the largest memory of each step: those of the run that
had everything to do.
"""

from __future__ import annotations

import argparse
import csv
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from experiments.record import ROOT, results_dir, write_atomically
from experiments.steps import STEPS, Progress, Step, code, progress, read_records
from experiments.table_text import to_csv

COLUMNS = ("step", "mode", "command", "seconds", "peak_bytes", "status", "code")
INTERRUPTED = "interrupted"
REPORT = "experiments.report"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the steps; 1 if one failed, 130 after an interruption."""
    parser = argparse.ArgumentParser(prog="python -m experiments.reproduce")
    parser.add_argument("--quick", action="store_true", help="fewer seeds")
    parser.add_argument("--list", action="store_true", help="show the steps, run none")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    results = results_dir()
    steps = [step for step in STEPS if step.command(chosen.quick)]
    console.print(overview(steps, chosen.quick, results))
    if chosen.list:
        return 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    return run(steps, chosen.quick, results, console)


def overview(steps: Sequence[Step], quick: bool, results: Path) -> Table:
    """What will run, what of it is finished, and about how long it takes."""
    found = _progress(steps, quick, results)
    total, left = (sum(getattr(p, name) for p in found) for name in ("total_s", "left_s"))
    table = Table(
        title=f"{'Quick' if quick else 'Full'} reproduction: about {span(total)} from nothing on 2 "
        f"cores, about {span(left)} of it left",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for head in ("step", "finished", "left", "command"):
        right = head in ("finished", "left")
        table.add_column(head, justify="right" if right else "left", no_wrap=head != "command")
    for step, p in zip(steps, found, strict=True):
        command = shlex.join(["python", "-m", *step.command(quick)])
        table.add_row(step.name, f"{p.finished} of {p.runs}", span(p.left_s), command)
    return table


def run(steps: Sequence[Step], quick: bool, results: Path, console: Console) -> int:
    """Run steps one after another, with the report after each stage; the exit status."""
    failed: list[str] = []
    try:
        for k, step in enumerate(steps):
            left = [p.left_s for p in _progress(steps[k:], quick, results)]
            console.rule(
                f"{k + 1} of {len(steps)}: {step.name}, about {span(left[0])}; with all that "
                f"follows about {span(sum(left))}",
                align="left",
            )
            if left[0]:
                status = _run_step(step, quick, results)
                failed += [f"{step.name}: {status}"] if status != "finished" else []
            else:
                console.print("finished before")
            if k + 1 == len(steps) or steps[k + 1].stage != step.stage:
                status = measured([REPORT])["status"]
                failed += [f"report after {step.name}: {status}"] if status != "finished" else []
    except KeyboardInterrupt:
        console.print("interrupted; the same command goes on")
        return 128 + signal.SIGINT
    for line in failed:
        console.print(f"[red]failed:[/red] {line}")
    return 1 if failed else 0


def _run_step(step: Step, quick: bool, results: Path) -> str:
    command = step.command(quick)
    row = {"step": step.name, "mode": _mode(quick), "command": shlex.join(command),
           "code": code(step)}  # fmt: skip
    start = time.perf_counter()
    try:
        row |= measured(command)
    except (KeyboardInterrupt, SystemExit):
        # What it took so far belongs to the time of the whole.
        taken = time.perf_counter() - start
        write(results, row | {"seconds": taken, "peak_bytes": 0, "status": INTERRUPTED})
        raise
    write(results, row)
    return str(row["status"])


def _progress(steps: Sequence[Step], quick: bool, results: Path) -> list[Progress]:
    records, before = read_records(results), read(results)
    return [progress(s, quick, records, before.get((s.name, _mode(quick)))) for s in steps]


def span(seconds: float) -> str:
    """A length of time as one would say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"


def measured(command: Sequence[str]) -> dict[str, Any]:
    """Run ``python -m`` with these words: seconds, peak memory and status.

    The memory is that of the largest process among it and its children, and at least what this
    process holds: about 40 MB.
    """
    sys.stdout.flush()  # what stands above is told first
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", *command], cwd=ROOT)
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except KeyboardInterrupt:
        process.wait()  # it was interrupted as well and writes its record
        raise
    except SystemExit:
        process.terminate()
        process.wait()
        raise
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "seconds": time.perf_counter() - start,
        "peak_bytes": usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024),
        "status": f"failed with {process.returncode}" if process.returncode else "finished",
    }


def read(results: Path) -> dict[tuple[str, str], dict[str, str]]:
    """Rows of tables/reproduce.csv by step and mode."""
    path = results / "tables" / "reproduce.csv"
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {(row["step"], row["mode"]): row for row in csv.DictReader(file)}


def write(results: Path, row: dict[str, Any]) -> None:
    """Put a step's row into tables/reproduce.csv, in the order of the steps."""
    rows: dict[tuple[str, str], Any] = read(results)
    key = row["step"], row["mode"]
    known = rows.get(key, {})
    same = (known.get("command"), known.get("code")) == (row["command"], row["code"])
    if same and known["status"] in (INTERRUPTED, row["status"]):
        # The rest of an interrupted step adds up; a repeated one finds most of its work done.
        pair = float(known["seconds"]), row["seconds"]
        row["seconds"] = sum(pair) if known["status"] == INTERRUPTED else max(pair)
        row["peak_bytes"] = max(row["peak_bytes"], int(known["peak_bytes"]))
    rows[key] = row
    order = {step.name: k for k, step in enumerate(STEPS)}
    ordered: Iterable[Any] = sorted(
        rows.values(), key=lambda r: (r["mode"], order.get(r["step"], len(order)))
    )
    write_atomically(results / "tables" / "reproduce.csv", to_csv(list(ordered), COLUMNS))


def _mode(quick: bool) -> str:
    return "quick" if quick else "full"


if __name__ == "__main__":
    sys.exit(main())
