"""Table I with one seed, in minutes: ``python -m experiments.table1``, which ``make table1`` calls.

The runs are those of ``python -m experiments.run experiment=table1``, one after another in this
process; what is finished is found finished. Shows one line of progress, then the table.
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir
from rich.console import Console
from rich.text import Text

from experiments import report
from experiments.protocol import job, machine
from experiments.records import configs, locks
from experiments.records.files import results_dir
from experiments.reporting.text import printable

EXPERIMENT = "table1"
MINUTES = 4  # from nothing on two quiet cores


def main() -> int:
    """Run every model of Table I, and show it; 1 if one failed, 130 after an interruption."""
    console = Console(width=report.WIDTH, highlight=False)
    # Records name the command that makes the same runs.
    sys.argv[1:] = [f"experiment={EXPERIMENT}"]
    try:
        failed = run(console)
        report.write(results_dir(), console, brief=True)
    except KeyboardInterrupt:
        console.print("interrupted; the same command resumes")
        return 128 + signal.SIGINT
    except (OSError, ValueError) as error:
        _complain(console, str(error))
        return 1
    return int(failed)


def run(console: Console) -> bool:
    """Carry out the runs that are not finished; whether one failed.

    Args:
        console: shows the progress in one line; where it is no terminal, how long it takes.
    """
    swept = configs.sweep(EXPERIMENT)
    machine.keep_memory()
    if not console.is_terminal:
        console.print(f"Table I: about {MINUTES} min on two quiet cores")
    failed = False
    for number, model in enumerate(swept["model"], 1):
        about = f"Table I, {number} of {len(swept['model'])}, {MINUTES} min in all: "
        try:
            _run_one(model, swept, console, about)
        except locks.Held as held:
            _complain(console, str(held))
        except (OSError, ValueError, RuntimeError) as error:
            failed = True
            _complain(console, f"{model}: {error}")
    return failed


def _run_one(
    model: str,
    swept: dict[str, list[str]],
    console: Console,
    about: str,
) -> None:
    chosen = {"scene": swept["scene"][0], "model": model, "stop": swept["stop"][0]}
    words = [f"{key}={value}" for key, value in chosen.items()]
    words.append(f"seed.run={swept['seed.run'][0].strip(chr(34))}")
    folder = str(Path(configs.CONFIGS))
    with initialize_config_dir(folder, version_base="1.3"):
        cfg = compose("config", [*words, f"experiment={EXPERIMENT}"])
        torch.set_num_threads(machine.threads(cfg.threads, {}))
        choices = {**chosen, "experiment": EXPERIMENT}
        job.run(cfg, choices, words, console, about)


def _complain(console: Console, text: str) -> None:
    console.print(Text(printable(text), "red"), soft_wrap=True)


if __name__ == "__main__":
    sys.exit(main())
