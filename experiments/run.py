"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and built anew,
and then trained under the clock; it is evaluated with the clock stopped. ``-m`` runs every
combination of the values given. A finished run is not repeated, and a run that another process is
at is left to it.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
import warnings
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
from experiments.records import locks
from experiments.records.files import results_dir
from experiments.reporting.terminal import summarise
from experiments.reporting.text import printable

console = Console()
stderr = Console(stderr=True, highlight=False)

# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, HydraException, OmegaConfBaseException)
_failures: list[
    Exception
] = []  # of this process; those of a launcher's workers come by Hydra

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
        machine.keep_memory()
        torch.set_num_threads(machine.threads(cfg.threads, hydra_cfg.launcher))
        chosen = dict(hydra_cfg.runtime.choices)
        if cfg.task is not None:
            job.check(cfg)
            switches = {key: cfg[key] for key in ("device", "cache", "force")}
            with job.exclusive(cfg, console):
                hydra.utils.instantiate(
                    cfg.task,
                    _recursive_=False,
                    _convert_="all",
                    name=chosen["experiment"],
                    scene_name=chosen["scene"],
                    **switches,
                )
            return
        summarise(
            console, *job.run(cfg, chosen, list(hydra_cfg.overrides.task), console)
        )
    except locks.Held as held:
        console.print(str(held), style="yellow", markup=False, soft_wrap=True)
    except Exception as error:
        if not _first:
            raise
        _complain(error)


_first = False  # whether this process was given the command line


def _complain(error: Exception) -> None:
    """Show an error and go on: the user's as one line, others with their traceback."""
    _failures.append(error)
    if isinstance(error, _USER_ERRORS):
        text = "\n".join(map(printable, _message(error).splitlines()))
        stderr.print("[red]error:[/red]", escape(text), soft_wrap=True, emoji=False)
    else:
        traceback.print_exception(error)


def _warn(message: Warning | str, *_: Any) -> None:
    stderr.print(
        "[yellow]warning:[/yellow]", escape(str(message)), soft_wrap=True, emoji=False
    )


def _message(error: BaseException) -> str:
    """The message of an error, in one line where it is Hydra's."""
    if isinstance(error, MissingConfigException) and error.options:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        return f"{group}: expected one of {', '.join(error.options)}, found {name}"
    if isinstance(error, HydraException | OmegaConfBaseException):
        lines = (line.strip() for line in str(error).splitlines())
        skipped = ("See https:", "object_type=")  # name nothing of the user's
        return ", ".join(
            line for line in lines if line and not line.startswith(skipped)
        )
    return str(error).strip()


def entry_point() -> None:
    """:func:`main`, with a user's error shown as one line; exits with 1 after any error."""
    global _first
    _first = True
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ["HYDRA_FULL_ERROR"] = (
        "1"  # Hydra's own errors come here, and leave as one line
    )
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
    sys.exit(1 if _failures else 0)


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
