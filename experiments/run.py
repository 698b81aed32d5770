"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and built anew,
and then trained under the clock; it is evaluated with the clock stopped. ``-m`` runs every
combination of the values given. A finished run is not repeated, and a run that another process is
at is left to it.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import sys
import time
import traceback
import warnings
from typing import Any

if __name__ == "__main__":
    # An interrupt ends the process while it imports: packages in C swallow the exception.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.errors import (
    HydraException,
    InstantiationException,
    MissingConfigException,
)
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments.protocol import job, machine, sweep
from experiments.records import locks
from experiments.records.environment import COMMAND
from experiments.records.files import results_dir
from experiments.reporting.summary import summarise
from experiments.reporting.text import printable

console = Console()
stderr = Console(stderr=True, highlight=False)

# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, HydraException, OmegaConfBaseException)
# Of this process; those of a launcher's workers come by Hydra.
_failures: list[Exception] = []
_left: list[locks.Held] = []  # to other processes
_warned: set[str] = set()  # what this process has warned of: a sweep says it once

warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
# configs/hydra/launcher changes parts of the launchers' own configs.
warnings.filterwarnings("ignore", message="(?s).*validated against ConfigStore schema")
OmegaConf.register_new_resolver(
    "results_dir", lambda: str(results_dir()), replace=True, use_cache=False
)


@hydra.main(version_base="1.3", config_path="../configs", config_name="config")
def main(cfg: DictConfig) -> None:
    """Run what the config says; in a multirun, go on with the others after one that failed."""
    # Launchers pickle this function by value, so that it must refer to nothing that has a lock.
    _job(cfg)


def _job(cfg: DictConfig) -> None:
    try:
        hydra_cfg = HydraConfig.get()
        if not _says(cfg.task, "own_memory"):
            machine.keep_memory()
        torch.set_num_threads(machine.threads(cfg.threads, hydra_cfg.launcher))
        _show_progress(cfg, hydra_cfg)
        if cfg.task is not None:
            _carry_out_task(cfg, hydra_cfg)
            return
        chosen = dict(hydra_cfg.runtime.choices)
        words = list(hydra_cfg.overrides.task)
        start = time.perf_counter()
        record, was_there = job.run(cfg, chosen, words, console)
        if _progress is not None and not was_there:
            _progress.took(time.perf_counter() - start)
        summarise(console, record, was_there)
    except Exception as error:
        if not _first:  # the process that was given the command line complains
            raise
        _complain(error)


def _carry_out_task(cfg: DictConfig, hydra_cfg: Any) -> None:
    """Measure an experiment that is more than a run."""
    job.check(cfg)
    chosen = hydra_cfg.runtime.choices
    switches = {key: cfg[key] for key in ("device", "cache", "force")}
    start = time.perf_counter()
    with job.exclusive(cfg, console):
        try:
            hydra.utils.instantiate(
                cfg.task,
                _recursive_=False,
                _convert_="all",
                name=chosen["experiment"],
                scene_name=chosen["scene"],
                **switches,
            )
        except InstantiationException as error:
            raise _of_task(error) from error
    if _progress is not None:
        _progress.took(time.perf_counter() - start)


def _of_task(error: InstantiationException) -> Exception:
    """The error of a task itself, its message with the key in front."""
    cause = error.__cause__
    if isinstance(cause, ImportError):  # there is no such task
        return error
    if isinstance(cause, ValueError) and not _NAMES_KEY.match(str(cause)):
        return ValueError(f"task: {cause}")
    return cause if isinstance(cause, Exception) else error


_NAMES_KEY = re.compile(
    r"[\w./-]+: "
)  # how a message begins that names a key or a file
_first = False  # whether this process was given the command line
_progress: sweep.Progress | None = None  # of a sweep in this process


def _show_progress(cfg: DictConfig, hydra_cfg: Any) -> None:
    """Say which run of a sweep begins; before the first, that it could run beside others."""
    global _progress
    if not _first or hydra_cfg.mode != RunMode.MULTIRUN:
        return
    if _progress is None:
        _progress = sweep.Progress(sweep.size(hydra_cfg.sweeper.params, sys.argv[1:]))
        if cfg.exclusive and cfg.task is not None and not _says(cfg.task, "timed"):
            text = "nothing of this is timed: exclusive=false runs it beside other runs"
            console.print(text, style="dim", soft_wrap=True)
    text = _progress.next(list(hydra_cfg.overrides.task))
    console.print(
        text,
        style="dim",
        markup=False,
        soft_wrap=True,
    )


def _says(task: DictConfig | None, name: str) -> bool:
    """Whether an experiment was declared with this attribute; a plain run has none, and neither
    has one that is not there, which is said where it is carried out."""
    if task is None:
        return False
    try:
        measured = hydra.utils.get_method(task["_target_"])
    except (ImportError, ValueError):
        return False
    return bool(getattr(measured, name, False))


def _complain(error: Exception) -> None:
    """Show an error and go on: the user's as one line, others with their traceback."""
    if isinstance(error, locks.Held):
        _left.append(error)
        console.print(str(error), style="yellow", markup=False, soft_wrap=True)
        return
    _failures.append(error)
    if isinstance(error, _USER_ERRORS):
        text = "\n".join(map(printable, _message(error).splitlines()))
        stderr.print(
            "[red]error:[/red]",
            escape(text),
            soft_wrap=True,
            emoji=False,
        )
    else:
        traceback.print_exception(error)


def _warn(message: Warning | str, *_: Any) -> None:
    but_for_numbers = re.sub(r"\d+", "", str(message))  # they differ from seed to seed
    if but_for_numbers in _warned:
        return
    _warned.add(but_for_numbers)
    stderr.print(
        "[yellow]warning:[/yellow]", escape(str(message)), soft_wrap=True, emoji=False
    )


def _message(error: BaseException) -> str:
    """The message of an error, in one line where it is Hydra's."""
    if isinstance(error, MissingConfigException) and error.options:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        return f"{group}: expected one of {', '.join(error.options)}, found {name}"
    if isinstance(error, InstantiationException):
        return _of_target(error)
    if isinstance(error, HydraException | OmegaConfBaseException):
        lines = (line.strip() for line in str(error).splitlines())
        skipped = ("See https:", "object_type=")  # name nothing of the user's
        return ", ".join(
            line for line in lines if line and not line.startswith(skipped)
        )
    return str(error).strip()


def _of_target(error: InstantiationException) -> str:
    """What Hydra could not build: the key, and why."""
    _, _, key = str(error).partition("full_key: ")
    found = re.search(r"locating target '([^']*)'", str(error))
    place = key.strip() or "config"
    if found:
        expected = "the dotted name of a class or a function"
        return f"{place}._target_: expected {expected}, found {found[1]}"
    reason = error.__cause__ or str(error).splitlines()[0]
    return f"{place}: {reason}"


def entry_point() -> None:
    """:func:`main`, with a user's error shown as one line.

    It exits with 1 after any error, and with :data:`locks.LEFT` where runs were left to another
    process.
    """
    global _first
    _first = True
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Hydra's own errors come here, and leave as one line.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    os.environ[COMMAND] = shlex.join(["python", "-m", "experiments.run", *sys.argv[1:]])
    warnings.showwarning = _warn  # type: ignore[assignment]
    # A scheduler's or a user's end of a run is written into its record, a closed terminal's too.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        main()
    except KeyboardInterrupt:
        stderr.print("interrupted; the same command resumes")
        sys.exit(128 + signal.SIGINT)
    except Exception as error:
        _complain(error)
    if _failures:
        sys.exit(1)
    sys.exit(locks.LEFT if _left else 0)


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
