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
from collections.abc import Sequence
from typing import Any

if __name__ == "__main__":
    # An interrupt ends the process while it imports: packages in C swallow the exception.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.markup import escape

from experiments.protocol import job, machine, sweep
from experiments.protocol.messages import is_users, message
from experiments.protocol.settings import named, resolved, settings_of
from experiments.records import locks
from experiments.records.environment import COMMAND
from experiments.records.files import results_dir
from experiments.reporting.summary import summarise
from experiments.reporting.text import printable


class CommandLine:
    """One call of the command: carries out its runs, and remembers how they ended.

    A run that fails is shown, and the next one begins. A worker of a launcher has a copy of this:
    there the run raises, and Hydra hands its error on.

    Args:
        words: of the command line.

    Attributes:
        failed: whether a run failed.
        left: whether a run was left to another process.
    """

    def __init__(self, words: Sequence[str]):
        self.failed = self.left = False
        self._words, self._process = list(words), os.getpid()
        self._seconds: list[float] = []  # of runs that were not found finished
        self._warned: set[str] = set()

    def carry_out(self, cfg: DictConfig) -> None:
        """One run, or one experiment that is more."""
        with warnings.catch_warnings():
            warnings.showwarning = self.warn  # type: ignore[assignment]
            self._carry_out(cfg)

    def _carry_out(self, cfg: DictConfig) -> None:
        """The same while warnings are shown in one line each."""
        try:
            hydra_cfg = HydraConfig.get()
            config = resolved(cfg)
            measured = named(config["task"])
            if not getattr(measured, "own_memory", False):
                machine.keep_memory()
            torch.set_num_threads(
                machine.threads(config["threads"], hydra_cfg.launcher)
            )
            if hydra_cfg.mode == RunMode.MULTIRUN:
                self._show_progress(config, measured, hydra_cfg)
            start = time.perf_counter()
            if measured is not None:
                _measure(config, measured, hydra_cfg.runtime.choices)
            elif not _run(config, hydra_cfg):
                return
            self._seconds.append(time.perf_counter() - start)
        except Exception as error:
            if os.getpid() != self._process:
                raise
            self.complain(error)

    def _show_progress(
        self, config: dict[str, Any], measured: Any, hydra_cfg: Any
    ) -> None:
        """Say which run of a sweep begins; before the first, that it could run beside others."""
        number = int(hydra_cfg.job.num) + 1
        is_timed = getattr(measured, "timed", True)
        if number == 1 and config["exclusive"] and not is_timed:
            _say("nothing of this is timed: exclusive=false runs it beside other runs")
        runs = sweep.size(hydra_cfg.sweeper.params, self._words)
        words = list(hydra_cfg.overrides.task)
        _say(sweep.progress(number, runs, words, self._seconds))

    def complain(self, error: Exception) -> None:
        """Show an error and go on: the user's as one line, others with their traceback."""
        if isinstance(error, locks.Held):
            self.left = True
            _say(str(error), style="yellow")
            return
        self.failed = True
        if not is_users(error):
            traceback.print_exception(error)
            return
        lines = message(error, self._words).splitlines()
        _tell("[red]error:[/red]", "\n".join(map(printable, lines)))

    def warn(self, text: Warning | str, *_: Any) -> None:
        """Show a warning, the first time but for its numbers, which differ from seed to seed."""
        but_for_numbers = re.sub(r"\d+", "", str(text))
        if but_for_numbers in self._warned:
            return
        self._warned.add(but_for_numbers)
        _tell("[yellow]warning:[/yellow]", str(text))


class Launch(Callback):
    """Says of a sweep whose workers print into files where they lie."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        """Called by Hydra before the first run."""
        folder = config.hydra.launcher.get("submitit_folder")
        if folder:
            _say(f"each run prints into {folder}/*.out")


def _say(text: str, style: str = "dim") -> None:
    """Print a line about the runs."""
    Console().print(text, style=style, markup=False, soft_wrap=True)


def _tell(kind: str, text: str) -> None:
    """Print an error or a warning into the stream of errors."""
    stderr = Console(stderr=True, highlight=False)
    stderr.print(kind, escape(text), soft_wrap=True, emoji=False)


def _run(config: dict[str, Any], hydra_cfg: Any) -> bool:
    """Carry out a run and show what came of it; False where it was there already."""
    chosen = dict(hydra_cfg.runtime.choices)
    words = list(hydra_cfg.overrides.task)
    console = Console()
    record, was_there = job.run(config, chosen, words, console)
    summarise(console, record, was_there)
    return not was_there


def _measure(config: dict[str, Any], measured: Any, choices: Any) -> None:
    """Measure an experiment that is more than a run."""
    settings = settings_of(config)
    arguments = {k: v for k, v in config["task"].items() if k != "_target_"}
    with job.exclusive(settings, Console()):
        measured(
            **arguments,
            name=choices["experiment"],
            scene_name=choices["scene"],
            device=settings.device,
            cache=settings.cache,
            force=settings.force,
        )


def entry_point() -> None:
    """Carry out the command line.

    It exits with 1 after any error, and with :data:`locks.LEFT` where runs were left to another
    process.
    """
    call = CommandLine(sys.argv[1:])
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Hydra's own errors come here, and leave as one line.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    os.environ[COMMAND] = shlex.join(["python", "-m", "experiments.run", *sys.argv[1:]])
    # A scheduler's or a user's end of a run is written into its record, a closed terminal's too.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        _start(call)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("interrupted; the same command resumes", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)
    except BrokenPipeError:  # whoever read the output has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(128 + signal.SIGPIPE)
    except Exception as error:
        call.complain(error)
    if call.failed:
        sys.exit(1)
    sys.exit(locks.LEFT if call.left else 0)


def _start(call: CommandLine) -> None:
    """Hand the command line to Hydra."""
    # Workers of a launcher get the resolver from Hydra.
    OmegaConf.register_new_resolver(
        "results_dir", lambda: str(results_dir()), replace=True, use_cache=False
    )
    main = hydra.main(
        version_base="1.3", config_path="../configs", config_name="config"
    )
    with warnings.catch_warnings():
        # configs/hydra/launcher changes parts of the launchers' own configs.
        text = "(?s).*validated against ConfigStore schema"
        warnings.filterwarnings("ignore", message=text)
        main(call.carry_out)()


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
