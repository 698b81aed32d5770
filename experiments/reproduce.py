"""Everything again, step by step: ``python -m experiments.reproduce``.

The steps are those of ``configs/reproduce.yaml``; results go to the folder of own results. Finished
work is skipped by the commands themselves, so that the same call resumes after an interruption. A
step that fails is named at the end, and the others run all the same. Steps that time nothing
(``timed: false``) run two at a time, with one thread each. ``--list`` shows the steps, and runs
none. ``reproduce.csv`` gets the time of each step, its calls added up, and its largest memory.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from experiments.protocol.sweep import span
from experiments.records import configs
from experiments.records.files import ROOT, results_dir
from hdc.io import write_atomically

FILE = "reproduce.csv"
LANES = 2  # steps that run at a time where nothing is timed
_UNIT = {"darwin": 1}.get(sys.platform, 1024)  # bytes that the system counts memory in
_INTERRUPTED = (
    -signal.SIGINT,
    -signal.SIGTERM,
    128 + signal.SIGINT,
    128 + signal.SIGTERM,
)
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
        timed: whether it measures times: it has the machine alone. Others run two at a time, with
            one thread each.
    """

    name: str
    words: tuple[str, ...]
    minutes: float
    needs: str | None = None
    timed: bool = True

    @property
    def all_words(self) -> tuple[str, ...]:
        """Its words, and those that make it share the machine."""
        if self.timed or self.words[0] != "experiments.run":
            return self.words
        beside = ("threads=1", "exclusive=false")
        return (*self.words, *(word for word in beside if word not in self.words))

    @property
    def command(self) -> str:
        return shlex.join(["python", "-m", *self.all_words])

    @property
    def wall_minutes(self) -> float:
        """Its share of the time that the whole takes."""
        return self.minutes if self.timed else self.minutes / LANES

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
    flag: dict[str, Any] = {
        "dest": "mode",
        "action": "store_const",
        "default": "full",
    }
    for mode in ("quick", "table1"):
        which.add_argument(
            f"--{mode}",
            const=mode,
            help=WHAT[mode],
            **flag,
        )
    parser.add_argument("--list", action="store_true", help="show the steps, run none")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    found = steps(chosen.mode)
    total = span(60 * sum(step.wall_minutes for step in found))
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
    found = []
    for step in configs.reproduction():
        if mode in step:
            words, minutes = tuple(shlex.split(step[mode])), step["minutes"][mode]
            needs, timed = step.get("needs"), step.get("timed", True)
            found.append(Step(step["name"], words, minutes, needs, timed))
    return found


def run(
    found: Sequence[Step],
    mode: str,
    results: Path,
    console: Console,
) -> int:
    """Run steps one after another, those that time nothing two at a time; the exit status."""
    statuses: dict[str, str] = {}
    left = list(found)
    try:
        for together in _lanes(found):
            for step in together:
                _announce(step, found, left, console)
            possible = [step for step in together if not step.skipped]
            statuses |= _carried_out(possible, mode, results)
            left = left[len(together) :]
    except KeyboardInterrupt:
        console.print("interrupted; the same command resumes")
        return 128 + signal.SIGINT
    failed = {name: text for name, text in statuses.items() if text != "finished"}
    for name, text in failed.items():
        console.print(f"[red]failed:[/red] {name}: {text}")
    return int(bool(failed))


def _announce(
    step: Step,
    found: Sequence[Step],
    left: Sequence[Step],
    console: Console,
) -> None:
    time_left = span(60 * sum(each.wall_minutes for each in left))
    number = found.index(step) + 1
    console.rule(
        f"{number} of {len(found)}: {step.name}; {time_left} left", align="left"
    )
    if step.skipped:
        console.print(f"[yellow]{step.name}: {step.skipped}[/yellow]")


def _lanes(found: Sequence[Step]) -> Iterator[list[Step]]:
    """Steps that run at the same time: neighbours that time nothing in pairs, others alone."""
    waiting: list[Step] = []
    for step in found:
        if step.timed:
            if waiting:
                yield waiting
            waiting = []
            yield [step]
            continue
        waiting.append(step)
        if len(waiting) == 2:
            yield waiting
            waiting = []
    if waiting:
        yield waiting


def _carried_out(
    steps: Sequence[Step],
    mode: str,
    results: Path,
) -> dict[str, str]:
    """Statuses of one or two steps, by name; an interruption ends both."""
    if len(steps) <= 1:
        return {step.name: measured(step, mode, results) for step in steps}
    with ThreadPoolExecutor(len(steps)) as lanes:
        futures = {s.name: lanes.submit(measured, s, mode, results) for s in steps}
        try:
            return {name: future.result() for name, future in futures.items()}
        except BaseException:
            for process in list(_running):
                process.terminate()
            raise


_running: set[subprocess.Popen[bytes]] = set()  # commands of this process
_writing = threading.Lock()  # of reproduce.csv, between the two lanes


def measured(
    step: Step,
    mode: str,
    results: Path,
) -> str:
    """Run a step, note its time and the memory of its largest process; its status."""
    sys.stdout.flush()  # what stands above is told first
    start, peak, status = time.perf_counter(), 0, "interrupted"
    environment = None if step.timed else {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", *step.all_words]
    process = subprocess.Popen(command, cwd=ROOT, env=environment)
    _running.add(process)
    try:
        _, ended, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
        peak = usage.ru_maxrss * _UNIT
        if process.returncode == 0:
            status = "finished"
        elif process.returncode not in _INTERRUPTED:
            status = f"failed with {process.returncode}"
    except BaseException as error:
        if not isinstance(error, KeyboardInterrupt):  # which it got as well
            process.terminate()
        process.wait()
        raise
    finally:
        _running.discard(process)
        row = {
            "step": step.name,
            "mode": mode,
            "command": step.command,
            "seconds": time.perf_counter() - start,
            "peak_bytes": peak,
            "status": status,
            "lanes": 1 if step.timed else LANES,
        }
        with _writing:
            note(results, row)
    return status


def note(results: Path, row: dict[str, Any]) -> None:
    """Put a call of a step into its row of reproduce.csv.

    Seconds of calls that broke off, interrupted or failed, add up with those of the call that
    finished the step. Of several that finished it the longest counts, as the others found work
    done. The memory is the largest of all.
    """
    rows = read(results)
    known = rows.get((row["step"], row["mode"]))
    if known and known["command"] == row["command"]:
        row["peak_bytes"] = max(row["peak_bytes"], int(known["peak_bytes"]))
        before = float(known["seconds"])
        if known["status"] != "finished":
            row["seconds"] += before
        elif row["status"] == "finished":
            row["seconds"] = max(row["seconds"], before)
        elif row["status"] == "interrupted":  # it had nothing to add
            row = {**known, "peak_bytes": row["peak_bytes"]}
    rows[row["step"], row["mode"]] = row
    write(results, rows.values())


def wall_seconds(row: Mapping[str, Any]) -> float:
    """Share of a step in the time that the whole took: two lanes ran at a time, or one."""
    lanes = row.get("lanes")
    if lanes is None or lanes != lanes:  # of a row written before there were lanes
        lanes = LANES if "exclusive=false" in row["command"] else 1
    return float(row["seconds"]) / float(lanes)


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


if __name__ == "__main__":
    sys.exit(main())
