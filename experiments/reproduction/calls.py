"""The commands of steps, called one after another or side by side, and what each took."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from rich.console import Console

from experiments.records import steps as records_of
from experiments.records.environment import commit
from experiments.records.files import ROOT
from experiments.records.locks import LEFT
from experiments.reproduction.steps import LANES, Step, cost_text
from experiments.reproduction.took import FINISHED, INTERRUPTED, note

_UNIT = {"darwin": 1}.get(sys.platform, 1024)  # bytes that the system counts memory in
_INTERRUPTED = (
    -signal.SIGINT,
    -signal.SIGTERM,
    128 + signal.SIGINT,
    128 + signal.SIGTERM,
)


def run(
    found: Sequence[Step],
    mode: str,
    results: Path,
    console: Console,
    lanes: int = LANES,
) -> int:
    """Run steps one after another, those that time nothing side by side; the exit status.

    Args:
        found: the steps, in their order.
        mode: which form of the steps it is, for reproduce.csv.
        results: folder of own results.
        console: is told which step begins.
        lanes: how many steps that time nothing run at a time.
    """
    calls = _Calls(found, mode, results, console)
    try:
        for timed, together in itertools.groupby(found, key=lambda step: step.timed):
            calls.carry_out(list(together), 1 if timed else lanes)
    except KeyboardInterrupt:
        console.print("interrupted; the same command resumes")
        return 128 + signal.SIGINT
    failed = {name: text for name, text in calls.statuses.items() if text != FINISHED}
    for name, text in failed.items():
        console.print(f"[red]failed:[/red] {name}: {text}")
    return int(bool(failed))


class _Calls:
    """Calls of steps: the status of each, the processes that are running."""

    def __init__(
        self, found: Sequence[Step], mode: str, results: Path, console: Console
    ):
        self.found, self.mode = list(found), mode
        self.results, self.console = results, console
        self.statuses: dict[str, str] = {}
        self._left = list(found)
        self._ending = False
        self._lock = threading.Lock()

    def carry_out(self, together: Sequence[Step], lanes: int) -> None:
        """Call steps, so many at a time; an interruption ends all of them."""
        if lanes == 1:
            for step in together:
                self._call(step, 1)
            return
        with ThreadPoolExecutor(lanes) as pool:
            futures = [pool.submit(self._call, step, lanes) for step in together]
            try:
                for future in futures:
                    future.result()
            except BaseException:
                self._end(futures)
                raise

    def _call(self, step: Step, lanes: int) -> None:
        with self._lock:
            if self._ending:
                return
            self._announce(step)
        if not step.skipped:
            status = measured(step, self.mode, self.results, lanes)
            self.statuses[step.name] = status
        with self._lock:
            self._left.remove(step)

    def _announce(self, step: Step) -> None:
        number = self.found.index(step) + 1
        text = f"{number} of {len(self.found)}: {step.name}"
        self.console.rule(f"{text}; {cost_text(self._left)} left", align="left")
        if step.skipped:
            self.console.print(f"[yellow]{step.name}: {step.skipped}[/yellow]")

    def _end(self, futures: Sequence[Future[None]]) -> None:
        """End what is running, begin nothing more."""
        with self._lock:
            self._ending = True
        for future in futures:
            future.cancel()
        for process in list(_running):
            process.terminate()


_running: set[subprocess.Popen[bytes]] = set()  # commands of this process
_writing = threading.Lock()  # of reproduce.csv, between the lanes


def measured(
    step: Step,
    mode: str,
    results: Path,
    lanes: int = 1,
) -> str:
    """Run a step, note its time and the memory of its largest process; its status."""
    sys.stdout.flush()  # what stands above is told first
    start, peak, status = time.perf_counter(), 0, INTERRUPTED
    records = records_of.place(results, mode, step.name)
    records_of.begin(records)
    environment = {**os.environ, records_of.VARIABLE: str(records)}
    if not step.timed:
        environment["OMP_NUM_THREADS"] = "1"
    command = [sys.executable, "-m", *step.all_words]
    process = subprocess.Popen(command, cwd=ROOT, env=environment)
    _running.add(process)
    try:
        _, ended, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
        peak = usage.ru_maxrss * _UNIT
        status = _status(process.returncode)
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
            "lanes": lanes,
            "commit": commit(),
        }
        with _writing:
            note(results, row)
    return status


def _status(code: int) -> str:
    """What the exit status of a command says of its step."""
    if code == 0:
        return FINISHED
    if code in _INTERRUPTED:
        return INTERRUPTED
    if code == LEFT:
        return "runs of it are left to another process; the same command resumes"
    return f"failed with {code}"
