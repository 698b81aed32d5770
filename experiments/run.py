"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and made anew,
and then trained under the clock; it is evaluated whenever it can predict, with the clock stopped.
``-m`` runs every combination of the values given; a finished run is not repeated.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
import warnings
from typing import Any

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments import record
from experiments.summary import summarise
from experiments.trial import instantiate, train_and_test
from scenes.frames import Scene

console = Console()
stderr = Console(stderr=True, highlight=False)

# Keys that say how a run is carried out, not what it computes.
_NOT_IDENTITY = ("force", "cache", "task")
# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, hydra.errors.HydraException, OmegaConfBaseException)

_process: int | None = None  # set where the command line was given
_failures: list[Exception] = []

OmegaConf.register_new_resolver(
    "results_dir", lambda: str(record.results_dir()), replace=True, use_cache=False
)


@hydra.main(version_base="1.3", config_path="../configs", config_name="config")
def main(cfg: DictConfig) -> None:
    """Run what the config says; in a multirun, go on with the others after one that failed."""
    try:
        torch.set_num_threads(_threads(cfg.threads))
        if cfg.task is not None:
            hydra.utils.instantiate(cfg.task, _recursive_=False, _convert_="all")
        else:
            run(cfg, dict(HydraConfig.get().runtime.choices))
    except Exception as error:
        # In a worker of a launcher, or when asked for, Hydra hands the error on.
        if os.getpid() != _process or os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        _failures.append(error)
        _complain(error)


def run(cfg: DictConfig, choices: dict[str, str | None]) -> dict[str, Any]:
    """Carry out one run, or find that it is finished; returns its record.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    for key in _NOT_IDENTITY:
        config.pop(key)
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(cfg.scene, "scene")
    fingerprint = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in ("scene", "model", "stop")}
    identity = record.run_id(names["scene"], names["model"], config, fingerprint)
    folder = record.results_dir() / "runs" / identity
    known = record.read_record(folder)
    if known and known["status"] == "finished" and not cfg.force:
        summarise(console, known, folder, repeated=True)
        return known
    entry: dict[str, Any] = {
        "schema": record.SCHEMA,
        "id": identity,
        "status": "running",
        "command": record.command(),
        "choices": names,
        "experiment": choices.get("experiment"),
        "config": config,
        "environment": record.environment(cfg.device, torch.get_num_threads(), config),
        "scene": {
            "name": names["scene"],
            "origin": scene.origin,
            "classes": list(scene.classes),
            "shape": list(scene.shape),
            "n": len(scene.labels),
            "fingerprint": fingerprint,
            "skipped": [str(frame) for frame in getattr(scene, "skipped", ())],
        },
    }
    record.write_record(folder, entry)
    (folder / "curve.csv").unlink(missing_ok=True)  # of an earlier attempt
    curve: list[dict[str, float]] = []
    try:
        entry |= train_and_test(
            cfg, scene, names, curve, record.results_dir() / "cache" if cfg.cache else None, console
        )
        entry["status"] = "finished"
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()
        raise
    finally:
        if curve:
            record.write_curve(folder, curve)
        record.write_record(folder, entry)
    summarise(console, entry, folder)
    return entry


def _threads(wanted: Any) -> int:
    if wanted is None:
        return (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
    if not isinstance(wanted, int) or isinstance(wanted, bool) or wanted < 1:
        raise ValueError(f"threads: expected an integer from 1, or null, found {wanted!r}")
    return wanted


def _complain(error: BaseException) -> None:
    if isinstance(error, _USER_ERRORS):
        stderr.print("[red]error:[/red]", escape(str(error).strip()), soft_wrap=True)
    else:
        traceback.print_exception(error)


def entry_point() -> None:
    """:func:`main`, with an error that is the user's shown as one line; exits with 1 after any."""
    global _process
    _process = os.getpid()
    warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
    # A scheduler's or a user's end of a run is written into its record.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        main()
    except KeyboardInterrupt:
        stderr.print("interrupted; the same command goes on")
        sys.exit(128 + signal.SIGINT)
    sys.exit(1 if _failures else 0)


if __name__ == "__main__":
    # As a module that workers of a launcher can import: nothing of it has to be pickled.
    from experiments.run import entry_point as start

    start()
