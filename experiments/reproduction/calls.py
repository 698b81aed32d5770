"""The commands of steps, called one after another or side by side, and what each took."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.console import Console

from experiments.records.environment import commit
from experiments.records.files import ROOT
from experiments.records.locks import LEFT
from experiments.records.record import STEP
from experiments.reproduction.steps import LANES, Step, cost_text
from experiments.reproduction.took import FINISHED, INTERRUPTED, Call, begin, end

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
) -> int:
    """Run steps one after another, those that time nothing side by side; the exit status.

    Args:
        found: the steps, in their order.
        mode: which form of the steps it is, for reproduce.csv.
        results: folder of own results.
        console: prints which step begins.
    """
    calls = _Calls(found, mode, results, console)
    try:
        for timed, together in itertools.groupby(found, key=lambda step: step.timed):
            calls.call_all(list(together), 1 if timed else LANES)
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
        self._processes = Processes()
        self._lock = threading.Lock()

    def call_all(self, together: Sequence[Step], lanes: int) -> None:
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
                for future in futures:
                    future.cancel()
                self._processes.end()
                raise

    def _call(self, step: Step, lanes: int) -> None:
        with self._lock:
            if self._processes.ended:
                return
            self._announce(step)
        if not step.skipped:
            self.statuses[step.name] = carry_out(
                step, self.mode, self.results, lanes, self._processes
            )
        with self._lock:
            self._left.remove(step)

    def _announce(self, step: Step) -> None:
        number = self.found.index(step) + 1
        text = f"{number} of {len(self.found)}: {step.name}"
        self.console.rule(f"{text}; {cost_text(self._left)} left", align="left")
        if step.skipped:
            self.console.print(f"[yellow]{step.name}: {step.skipped}[/yellow]")


class Processes:
    """The commands that are running, of every lane; after :meth:`end` none begins."""

    def __init__(self) -> None:
        self.ended = False
        self._running: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()

    def start(
        self, command: Sequence[str], environment: Mapping[str, str]
    ) -> subprocess.Popen[bytes]:
        """Start a command.

        Raises:
            KeyboardInterrupt: it may not begin any more.
        """
        # Held meanwhile: a command that began while the others are ended would stay behind.
        with self._lock:
            if self.ended:
                raise KeyboardInterrupt
            process = subprocess.Popen(command, cwd=ROOT, env=environment)
            self._running.add(process)
            return process

    def forget(self, process: subprocess.Popen[bytes]) -> None:
        """Take out a command that has ended."""
        with self._lock:
            self._running.discard(process)

    def end(self) -> None:
        """End what is running."""
        with self._lock:
            self.ended = True
            for process in self._running:
                process.terminate()


def carry_out(
    step: Step,
    mode: str,
    results: Path,
    lanes: int = 1,
    processes: Processes | None = None,
) -> str:
    """Run a step, note its time and the memory of its largest process; its status."""
    processes = processes or Processes()
    sys.stdout.flush()  # what stands above is printed first
    environment = {**os.environ, STEP: f"{mode}/{step.name}"}
    if not step.timed:
        environment["OMP_NUM_THREADS"] = "1"
    command = [sys.executable, "-m", *step.all_words]
    row: Call = {
        "step": step.name,
        "mode": mode,
        "command": step.command,
        "seconds": 0.0,
        "peak_bytes": 0,
        "status": INTERRUPTED,
        "lanes": lanes,
        "commit": commit(),
    }
    known = begin(results, row)
    start = time.perf_counter()
    process = processes.start(command, environment)
    try:
        _, ended, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
        row["peak_bytes"] = usage.ru_maxrss * _UNIT
        row["status"] = _status(process.returncode)
    except BaseException as error:
        if not isinstance(error, KeyboardInterrupt):  # which it got as well
            process.terminate()
        process.wait()
        raise
    finally:
        processes.forget(process)
        row["seconds"] = time.perf_counter() - start
        end(results, row, known)
    return str(row["status"])


def _status(code: int) -> str:
    """Outcome of a step by the exit status of its command."""
    if code == 0:
        return FINISHED
    if code in _INTERRUPTED:
        return INTERRUPTED
    if code == LEFT:
        return "runs of it are left to another process; the same command resumes"
    return f"failed with {code}"
