"""Steps carried out by make: timed ones one at a time, then the others two at a time.

A step is finished by its records, and by a stamp that is written last and holds its seconds. Stamps
lie below a digest of code and configs: other code begins anew, and its commands find what of the
records is still valid. A kill at any moment loses the run that was being made and nothing else.
"""

from __future__ import annotations

import hashlib
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console

from experiments.records import locks
from experiments.records.console import say
from experiments.records.files import ROOT
from experiments.records.revision import PACKAGES
from experiments.reproduction.steps import LANES, Step, able
from hdc.io import write_atomically

FOLDER = "reproduce"  # of makefiles and stamps, in the folder of results


def run(found: Sequence[Step], mode: str, results: Path, console: Console) -> int:
    """Carry out steps that are not finished; the exit status.

    Args:
        found: the steps, in their order.
        mode: which form of the steps it is.
        results: folder of own results.
        console: prints what is skipped, and what failed.

    Raises:
        locks.Held: another process is at it.
    """
    stamps = folder_of_stamps(results, mode)
    makefile = results / FOLDER / f"{mode}.mk"
    with locks.held(results / "cache" / "locks" / FOLDER, "the reproduction"):
        for step in found:
            if step.skipped:
                say(console, f"{step.name}: {step.skipped}", "yellow")
        left = [step for step in able(found) if not (stamps / step.name).exists()]
        stamps.mkdir(parents=True, exist_ok=True)
        write_atomically(makefile, "\n".join(_makefile(left, stamps)) + "\n")
        for goal, lanes in (("timed", 1), ("untimed", LANES)):
            status = _make(makefile, goal, lanes)
            if status:
                say(console, "interrupted; the same command resumes")
                return status
    failed = [step.name for step in left if not (stamps / step.name).exists()]
    for name in failed:
        say(console, f"failed: {name}; the same command tries it again", "red")
    return int(bool(failed))


def folder_of_stamps(results: Path, mode: str) -> Path:
    """Where the stamps of a mode lie for today's code."""
    return results / FOLDER / digest_of_code() / mode


def digest_of_code() -> str:
    """Twelve digits that tell states of code and configs apart."""
    digest = hashlib.sha256()
    for package in (*PACKAGES, "configs"):
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(str(path.relative_to(ROOT)).encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _make(makefile: Path, goal: str, lanes: int) -> int:
    """Bring one goal about; 0, or the status of a command that was interrupted."""
    sys.stdout.flush()  # what stands above is printed first
    command = ["make", "--no-print-directory", "-k", "-f", str(makefile)]
    process = subprocess.Popen([*command, f"-j{lanes}", goal], cwd=ROOT)
    try:
        process.wait()
    except KeyboardInterrupt:  # which has reached make as well
        process.wait()
        return 128 + signal.SIGINT
    except SystemExit:
        process.terminate()
        process.wait()
        raise
    return 0


def _makefile(found: Sequence[Step], stamps: Path) -> Iterator[str]:
    """A target per step. Its recipe says how far it is, runs the command and writes the stamp."""
    yield ".DELETE_ON_ERROR:"
    yield ".PHONY: timed untimed"
    for goal, timed in (("timed", True), ("untimed", False)):
        targets = [_escaped(stamps / s.name) for s in found if s.timed == timed]
        yield f"{goal}: {' '.join(targets)}"
    ordered = sorted(found, key=lambda step: not step.timed)
    for number, step in enumerate(ordered):
        text = f"{number + 1} of {len(ordered)}: {step.name}"
        threads = "" if step.timed else "OMP_NUM_THREADS=1 "
        command = shlex.join([sys.executable, "-m", *step.all_words])
        yield f"{_escaped(stamps / step.name)}:"
        yield f"\t@echo {shlex.quote(text)}"
        yield (
            f"\t@begin=$$(date +%s); {threads}{command.replace('$', '$$')} "
            "&& echo $$(($$(date +%s) - begin)) > '$@'"
        )


def _escaped(path: Path) -> str:
    """A path as make reads it."""
    text = str(path).replace("$", "$$")
    for sign in (" ", "#", ":"):
        text = text.replace(sign, f"\\{sign}")
    return text
