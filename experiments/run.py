"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and built anew,
and then trained under the clock; it is evaluated with the clock stopped. ``-m`` runs every
combination of the values given. A finished run is not repeated, and a run that another process is
at is left to it. ``experiment=NAME`` carries out an experiment of ``configs/experiment/``.
"""

from __future__ import annotations

import difflib
import os
import re
import shlex
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    # An interrupt ends the process while it imports: packages in C swallow the exception.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import hydra
import torch
from hydra import compose, initialize_config_dir
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments.protocol import machine
from experiments.protocol.needs import needs
from experiments.protocol.runner import Asked, carry_out
from experiments.protocol.settings import resolved
from experiments.protocol.validation import ACCURACY
from experiments.records import configs, locks
from experiments.records.console import printable, say
from experiments.records.environment import COMMAND
from experiments.records.files import results_dir
from experiments.records.record import Record
from experiments.reporting.summary import summarise

# What a user can mend: one line. Others are ours, and have a traceback.
_USER_ERRORS = (ValueError, OSError, HydraException, OmegaConfBaseException)
# What Hydra adds to its messages, which names nothing of the user's.
_CHAINED = "set env var HYDRA_FULL_ERROR=1 to see chained exception."
_OF_NO_USER = ("See https:", "object_type=")
# Keys that say how any task is carried out.
_OF_ANY = ("device", "threads", "exclusive", "cache", "force", "experiment")
# What an experiment may set of its runs.
_PARTS = ("scene", "split", "model", "stop")


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
    os.environ[COMMAND] = _command(overrides)
    return _made(resolved(own), cfg.hydra, Console(highlight=False))[0]


class CommandLine:
    """One call of the command: carries out its runs, and remembers how they ended.

    A run that fails is shown, and the next one begins. A worker of a launcher has a copy of this:
    there the run raises, and Hydra hands its error on.

    Attributes:
        status: to exit with: 1 after any error, else :data:`locks.LEFT` where a run was left to
            another process, else 0.
    """

    def __init__(self) -> None:
        self.status = 0
        self._process = os.getpid()
        self._warned: set[str] = set()
        self._told = {""}  # lines of what runs need

    def carry_out(self, cfg: DictConfig) -> float | None:
        """One run. Returns what a sweeper may optimise, if the run has it: the accuracy inside the
        training frames."""
        with self.shown():
            hydra_cfg, config = HydraConfig.get(), resolved(cfg)
            for word in _without_effect(cfg, hydra_cfg.overrides.task):
                _say(f"{word}: nothing of this experiment depends on it", "yellow")
            told = needs(config)
            if told not in self._told:
                self._told.add(told)
                _say(told)
            console = Console()
            record, was_there = _made(config, hydra_cfg, console)
            summarise(console, record, was_there)
            found = [row[ACCURACY] for row in record.rows.dicts() if ACCURACY in row]
            return sum(found) / len(found) if found else None
        return None

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show an error and the warnings of what runs inside, and go on."""
        with warnings.catch_warnings():
            warnings.showwarning = self._warn  # type: ignore[assignment]
            try:
                yield
            except Exception as error:
                if os.getpid() != self._process:
                    raise
                self._complain(error)

    def _complain(self, error: Exception) -> None:
        """Show the user's errors as one line, others with their traceback."""
        if isinstance(error, locks.Held):
            self.status = self.status or locks.LEFT
            _say(str(error), style="yellow")
            return
        self.status = 1
        if isinstance(error, _USER_ERRORS):
            _tell("[red]error:[/red]", _in_one_line(error))
        else:
            traceback.print_exception(error)

    def _warn(self, text: Warning | str, *_: Any) -> None:
        """Show a warning, the first time but for its numbers, which differ from seed to seed."""
        but_for_numbers = re.sub(r"\d+", "", str(text))
        if but_for_numbers not in self._warned:
            self._warned.add(but_for_numbers)
            _tell("[yellow]warning:[/yellow]", str(text))


def _in_one_line(error: Exception) -> str:
    """The message of an error; of a file of ``configs/`` that there is not, with the nearest."""
    if isinstance(error, MissingConfigException) and error.options:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        text = f"{group}: expected one of {', '.join(error.options)}, found {name}"
        meant = difflib.get_close_matches(name, error.options, 1)
        return f"{text}; did you mean {meant[0]}?" if meant else text
    text = str(error).replace(_CHAINED, "")
    lines = [line.strip(" .,") for line in text.splitlines()]
    if isinstance(error, OverrideParseException):
        lines.insert(0, error.override)
    shown = [line for line in lines if line and not line.startswith(_OF_NO_USER)]
    return printable(", ".join(shown))


class Launch(Callback):
    """Says at the end of a sweep where its records lie."""

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        """Called by Hydra after the last run."""
        _say(f"records: {results_dir()}; tables of them: python -m experiments.report")


def _made(
    config: dict[str, Any], hydra_cfg: Any, console: Console
) -> tuple[Record, bool]:
    """The record of a config, and whether it was there already."""
    machine.keep_memory()
    torch.set_num_threads(machine.threads(config["threads"], hydra_cfg.launcher))
    return carry_out(config, _asked(hydra_cfg), console)


def _without_effect(cfg: DictConfig, words: Sequence[str]) -> list[str]:
    """Words of the command line that set a part of the config which the task does not name."""
    if cfg.task is None:
        return []
    task = OmegaConf.to_yaml(cfg.task)
    named = {part for part in map(str, cfg) if f"${{{part}" in task}
    if "seeds" in cfg.task:  # which sets every seed
        named.discard("seed")
    return [
        word
        for word in words
        if _key(word).partition(".")[0] not in ("task", *_OF_ANY, *named)
    ]


def _key(word: str) -> str:
    """The dotted key that a word of the command line sets."""
    return word.lstrip("+~").partition("=")[0].rpartition("@")[2]


def _command(words: Sequence[str]) -> str:
    return shlex.join(["python", "-m", "experiments.run", *words])


def _asked(hydra_cfg: Any) -> Asked:
    """Choices and settings of the command line and of the experiment's file."""
    choices = dict(hydra_cfg.runtime.choices)
    keys = [_key(word) for word in hydra_cfg.overrides.task]
    file = _experiment(choices.get("experiment"), hydra_cfg)
    keys += configs.flat({part: file[part] for part in _PARTS if part in file})
    return Asked(choices, keys)


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


def entry_point() -> None:
    """Carry out the command line."""
    call = CommandLine()
    # Hydra's own errors come here, and leave as one line.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    os.environ[COMMAND] = _command(sys.argv[1:])
    with ended_by_signals(), call.shown():
        _start(call)
    sys.exit(call.status)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """An end from outside leaves a record of how far a run came, and the exit status says which."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Of a scheduler, a user, a closed terminal.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        yield
    except KeyboardInterrupt:
        print("interrupted; the same command resumes", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)


def _start(call: CommandLine) -> None:
    """Hand the command line to Hydra."""
    # Workers of a launcher get the resolver from Hydra.
    OmegaConf.register_new_resolver(
        "results_dir", lambda: str(results_dir()), replace=True, use_cache=False
    )
    main = hydra.main(
        version_base="1.3", config_path="../configs", config_name="config"
    )
    # configs/hydra/launcher changes parts of the launchers' own configs.
    text = "(?s).*validated against ConfigStore schema"
    warnings.filterwarnings("ignore", message=text)
    main(call.carry_out)()


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
