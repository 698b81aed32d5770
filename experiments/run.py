"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and made anew,
and then trained under the clock; it is evaluated whenever it can predict, with the clock stopped.
``-m`` runs every combination of the values given; a finished run is not repeated, and one that
another process is at is left to it. One that took unlike as long as its siblings is made again,
once (:mod:`experiments.records.timing`).
"""

from __future__ import annotations

import difflib
import os
import re
import signal
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Any

if __name__ == "__main__":
    # An interrupt ends the process while it imports: packages in C swallow the exception.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments.protocol import job, machine
from experiments.records import locks, sweep
from experiments.records.files import results_dir
from experiments.reporting.terminal import in_any_encoding, summarise

console = Console()
stderr = Console(stderr=True, highlight=False)

# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, HydraException, OmegaConfBaseException)
_PATHS = re.compile(r"\+{0,2}([\w.]*path)=(.*)", re.DOTALL)
_PLAIN = re.compile(r"[\w.-]*/[\w./-]*", re.ASCII)  # what Hydra's grammar takes as it is
_NO_PATHS = ("null", "???")

_NO_HELP = ("See https:", "object_type=")  # lines of Hydra's that name nothing of the user's

_TRACEBACKS = "OPTICAL_HDC_TRACEBACKS"  # in the environment, of this process and its workers
_process: int | None = None  # set where the command line was given
_failures: list[Exception] = []

warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
# What configs/hydra/launcher changes of the launchers' own configs is to be checked against them.
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
        machine.keep_memory()
        torch.set_num_threads(machine.threads(cfg.threads, hydra_cfg.launcher))
        if cfg.task is not None:
            job.check(cfg)
            with job.exclusive(cfg, console):
                hydra.utils.instantiate(cfg.task, _recursive_=False, _convert_="all")
            return
        chosen, typed = dict(hydra_cfg.runtime.choices), list(hydra_cfg.overrides.task)
        summarise(console, *job.run(cfg, chosen, typed, console))
    except locks.Held as held:
        console.print(str(held), style="yellow", markup=False, soft_wrap=True)
        sweep.note(sweep.LEFT, held.what)
    except Exception as error:
        if _TRACEBACKS in os.environ:
            raise
        _complain(error)
        if os.getpid() == _process:
            _failures.append(error)
        elif not sweep.note(sweep.FAILED, f"{_overrides()}: {type(error).__name__}: {error}"):
            raise


def _overrides() -> str:
    """What makes this run of a sweep differ from the others, as a user would type it."""
    return " ".join(HydraConfig.get().overrides.task)


def _complain(error: BaseException) -> None:
    if isinstance(error, _USER_ERRORS):
        # Control characters in what an error quotes are shown, and no :emoji: is drawn.
        plain = (c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in _said(error))
        stderr.print("[red]error:[/red]", escape("".join(plain)), soft_wrap=True, emoji=False)
    else:
        traceback.print_exception(error)


def _warn(message: Warning | str, *_: Any) -> None:
    """A warning as one line, in the place of Python's two with a file of ours."""
    stderr.print("[yellow]warning:[/yellow]", escape(str(message)), soft_wrap=True, emoji=False)


def _said(error: BaseException) -> str:
    """What an error says, in one line where it is Hydra's."""
    if isinstance(error, MissingConfigException) and error.options:
        return _no_choice(str(error.missing_cfg_file), error.options)
    if isinstance(error, HydraException | OmegaConfBaseException):
        lines = (line.strip() for line in str(error).splitlines())
        return ", ".join(line for line in lines if line and not line.startswith(_NO_HELP))
    return str(error).strip()


def _no_choice(missing: str, options: Sequence[str]) -> str:
    """Which choices there are, and which is near."""
    group, _, found = missing.rpartition("/")
    near = difflib.get_close_matches(found, options, 1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"{group}: expected one of {', '.join(options)}, found {found}{hint}"


def _argument(text: str) -> str:
    """An argument of the command line; a path in it is taken as it is, whatever Hydra's grammar
    says of its blanks and brackets, and ~ is the home folder."""
    if not (match := _PATHS.fullmatch(text)):
        return text
    path = os.path.expanduser(match[2])
    known = os.path.exists(path)
    if "${" in path or (not known and (path[:1] in "'\"[{" or path in _NO_PATHS or "," in path)):
        return text  # an interpolation, quoted already, or several paths of a sweep
    if not _PLAIN.fullmatch(path):
        # Backslashes count double before a quote and at the end, and nowhere else.
        path = re.sub(r'(\\*)("|\Z)', lambda m: 2 * m[1] + (m[2] and '\\"'), path)
        path = f'"{path}"'
    return text[: match.start(2)] + path


def entry_point() -> None:
    """:func:`main`, with an error that is the user's shown as one line; exits with 1 after any."""
    global _process
    _process = os.getpid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    in_any_encoding()
    sys.argv[1:] = map(_argument, sys.argv[1:])
    if os.environ.get("HYDRA_FULL_ERROR") == "1":
        os.environ[_TRACEBACKS] = "1"
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra's own errors come here, and leave as one line
    warnings.showwarning = _warn  # type: ignore[assignment]
    sweep.begin()
    # A scheduler's or a user's end of a run is written into its record, a closed terminal's too.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        main()
    except KeyboardInterrupt:
        stderr.print("interrupted; the same command goes on")
        sys.exit(128 + signal.SIGINT)
    except Exception as error:
        if _TRACEBACKS in os.environ:
            raise
        if isinstance(error, OSError) and error.errno and error.filename is None:  # Hydra's own
            error = OSError(error.errno, error.strerror, str(results_dir()))
        _complain(error)
        _failures.append(error)
    finally:
        left, failed = sweep.notes(sweep.LEFT), sweep.notes(sweep.FAILED)
        sweep.end()
    for text in failed:
        stderr.print("[red]error:[/red]", escape(text), soft_wrap=True)
    if left:
        console.print(
            f"{len(left)} left to other processes: {', '.join(left)}", markup=False, soft_wrap=True
        )
    sys.exit(1 if _failures or failed else 0)


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
