"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and built anew,
and then trained under the clock; it is evaluated with the clock stopped. ``-m`` runs every
combination of the values given. A finished run is not repeated, and a run that another process is
at is left to it. ``experiment=NAME`` carries out an experiment of ``configs/experiment/``.
"""

from __future__ import annotations

import copy
import os
import re
import shlex
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    # An interrupt ends the process while it imports: packages in C swallow the exception.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import hydra
import torch
from hydra import compose, initialize_config_dir
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments.protocol import machine, sweep
from experiments.protocol.messages import is_users, message
from experiments.protocol.needs import needs
from experiments.protocol.runner import Asked, carry_out, task_class
from experiments.protocol.settings import resolved
from experiments.protocol.validation import ACCURACY
from experiments.records import configs, locks
from experiments.records.console import printable, say
from experiments.records.environment import COMMAND
from experiments.records.files import results_dir
from experiments.records.record import Record
from experiments.reporting.summary import summarise

# Keys that say how any task is carried out.
_OF_ANY = ("device", "threads", "exclusive", "cache", "force", "experiment")
# What an experiment may set of its runs; and its default that says which frames there are.
_PARTS, _SCENE = ("scene", "split", "model", "stop"), "override /scene"


def run(*overrides: str) -> Record:
    """One run from Python, a notebook say: its record, made now or found finished.

    Args:
        overrides: words of the command line, such as ``"model=softmax", "seed.run=3"``.

    Raises:
        ValueError: a key or a value is wrong; Hydra's own errors name the word.
        locks.Held: another process is at this run.
    """
    with initialize_config_dir(str(configs.CONFIGS), version_base="1.3"):
        cfg = compose("config", list(overrides), return_hydra_config=True)
    own = OmegaConf.masked_copy(cfg, [str(key) for key in cfg if key != "hydra"])
    before = os.environ.get(COMMAND, "")
    os.environ[COMMAND] = _command(overrides)
    try:
        return _made(resolved(own), cfg.hydra, Console(highlight=False))[0]
    finally:
        os.environ[COMMAND] = before


class CommandLine:
    """One call of the command: carries out its runs, and remembers how they ended.

    A run that fails is shown, and the next one begins. A worker of a launcher has a copy of this:
    there the run raises, and Hydra hands its error on.

    Args:
        words: of the command line.
        brief: whether results are shown by the caller; progress and errors are shown here.

    Attributes:
        failed: whether a run failed.
        left: whether a run was left to another process.
    """

    def __init__(self, words: Sequence[str], brief: bool = False):
        self.failed = self.left = False
        self._brief = brief
        self._words, self._process = list(words), os.getpid()
        self._seconds: list[float] = []  # of runs that were not found finished
        self._warned: set[str] = set()
        self._told = {""}  # lines of what runs need

    def carry_out(self, cfg: DictConfig) -> float | None:
        """One run. Returns what a sweeper may optimise, if the run has it: the accuracy inside the
        training frames."""
        with warnings.catch_warnings():
            warnings.showwarning = self.warn  # type: ignore[assignment]
            try:
                return self._carry_out(cfg)
            except Exception as error:
                if os.getpid() != self._process:
                    raise
                self.complain(error)
                return None

    def _carry_out(self, cfg: DictConfig) -> float | None:
        hydra_cfg, config = HydraConfig.get(), resolved(cfg)
        task = task_class(config)
        for word in _without_effect(cfg, hydra_cfg.overrides.task):
            seeds = "; its seeds are task.seeds" if "seeds" in cfg.task else ""
            _say(f"{word}: nothing of this experiment depends on it{seeds}", "yellow")
        if hydra_cfg.mode == RunMode.MULTIRUN:
            self._show_progress(config["exclusive"] and not task.timed, hydra_cfg)
        told = needs(config)
        if told not in self._told:
            self._told.add(told)
            _say(told)
        start, console = time.perf_counter(), Console()
        record, was_there = _made(config, hydra_cfg, console)
        if not self._brief:
            summarise(console, record, was_there)
        if not was_there:
            self._seconds.append(time.perf_counter() - start)
        found = [row[ACCURACY] for row in record.rows.dicts() if ACCURACY in row]
        return sum(found) / len(found) if found else None

    def _show_progress(self, could_share: bool, hydra_cfg: Any) -> None:
        """Say which run of a sweep begins; before the first, that it could run beside others."""
        number = int(hydra_cfg.job.num) + 1
        if number == 1 and could_share:
            _say("nothing of this is timed: exclusive=false runs it beside other runs")
        params = hydra_cfg.sweeper.get("params")
        # A sweeper that chooses values, as Optuna's, says how many trials it makes.
        trials = hydra_cfg.sweeper.get("n_trials")
        runs = trials or sweep.size(params, self._words)
        if runs > 1:
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
    """Says where workers print, and at the end of a sweep where its records lie."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        """Called by Hydra before the first run."""
        folder = config.hydra.launcher.get("submitit_folder")
        if folder:
            _say(f"each run prints into {folder}/*.out")

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        """Called by Hydra after the last run."""
        params, words = config.hydra.sweeper.get("params"), config.hydra.overrides.task
        if sweep.size(params, words) > 1:
            _say(
                f"records: {results_dir()}; tables of them: python -m experiments.report"
            )


def _made(
    config: dict[str, Any], hydra_cfg: Any, console: Console
) -> tuple[Record, bool]:
    """The record of a config, and whether it was there already."""
    machine.keep_memory()
    torch.set_num_threads(machine.threads(config["threads"], hydra_cfg.launcher))
    return carry_out(config, _asked(hydra_cfg), console)


def _without_effect(cfg: DictConfig, words: Sequence[str]) -> Iterator[str]:
    """Words of the command line on which the task of an experiment does not depend: with another
    value of the key it is the same."""
    if cfg.task is None:
        return
    task = OmegaConf.to_container(cfg.task, resolve=True)
    for word in words:
        key = word.lstrip("+~").partition("=")[0].partition("@")[0]
        if key.partition(".")[0] in ("task", *_OF_ANY):
            continue
        if key.startswith("seed.") and "seeds" in cfg.task:  # which it sets everywhere
            yield word
            continue
        other = copy.deepcopy(cfg)
        OmegaConf.update(other, key, "another", force_add=True)
        try:
            same = OmegaConf.to_container(other.task, resolve=True) == task
        except OmegaConfBaseException:  # it refers to what lies below the key
            same = False
        if same:
            yield word


def _command(words: Sequence[str]) -> str:
    return shlex.join(["python", "-m", "experiments.run", *words])


def _asked(hydra_cfg: Any) -> Asked:
    """Choices and settings of the command line and of the experiment's file."""
    choices = dict(hydra_cfg.runtime.choices)
    words = (word.lstrip("+~").partition("=")[0] for word in hydra_cfg.overrides.task)
    keys = [word.rpartition("@")[2] for word in words]
    file = _experiment(choices.get("experiment"), hydra_cfg)
    keys += configs.flat({part: file[part] for part in _PARTS if part in file})
    chosen = {_SCENE: "touch"}  # as configs/config.yaml
    for entry in file.get("defaults", ()):
        chosen |= entry if isinstance(entry, dict) else {}
    return Asked(choices, keys, bool(file) and choices.get("scene") != chosen[_SCENE])


def _experiment(name: str | None, hydra_cfg: Any) -> dict[str, Any]:
    """The file of an experiment as it stands, in ``configs/`` or in the user's ``--config-dir``."""
    sources = hydra_cfg.runtime.config_sources
    folders = [Path(source.path) for source in sources if source.schema == "file"]
    # Hydra names the own folder as a package where this runs as a module.
    for folder in (*folders, configs.CONFIGS):
        path = folder / "experiment" / f"{name}.yaml"
        if path.is_file():
            found: Any = OmegaConf.to_container(OmegaConf.load(path))
            return found  # type: ignore[no-any-return]
    return {}


def _say(text: str, style: str = "dim") -> None:
    """Print a line about the runs."""
    say(Console(), text, style)


def _tell(kind: str, text: str) -> None:
    """Print an error or a warning into the stream of errors."""
    stderr = Console(stderr=True, highlight=False)
    stderr.print(kind, escape(text), soft_wrap=True, emoji=False)


def entry_point(brief: bool = False) -> None:
    """Carry out the command line; in brief, the caller shows the results.

    It exits with 1 after any error, and with :data:`locks.LEFT` where runs were left to another
    process.
    """
    call = CommandLine(sys.argv[1:], brief)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Hydra's own errors come here, and leave as one line.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    os.environ[COMMAND] = _command(sys.argv[1:])
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
