"""One config, one record: ``python -m experiments.run scene=touch model=hdc``.

Frames are made or read, the model is warmed up on other frames of the same shape and made anew,
and then trained under the clock; it is evaluated whenever it can predict, with the clock stopped.
``-m`` runs every combination of the values given; a finished run is not repeated, and one that
another process is at is left to it.
"""

from __future__ import annotations

import copy
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Any

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.markup import escape

from experiments import blas, cores, data, distributed, locks, record, sweep
from experiments.summary import summarise
from experiments.trial import instantiate, train_and_test
from scenes.frames import Scene

console = Console()
stderr = Console(stderr=True, highlight=False)

# Errors that are the user's to mend: shown as one line. All others are ours, with their traceback.
_USER_ERRORS = (ValueError, OSError, hydra.errors.HydraException, OmegaConfBaseException)

_process: int | None = None  # set where the command line was given
_failures: list[Exception] = []

warnings.filterwarnings("ignore", message=".*hydra.run.dir.*")
# What configs/hydra/launcher changes of the launchers' own configs is to be checked against them.
warnings.filterwarnings("ignore", message="(?s).*validated against ConfigStore schema")
OmegaConf.register_new_resolver(
    "results_dir", lambda: str(record.results_dir()), replace=True, use_cache=False
)


@hydra.main(version_base="1.3", config_path="../configs", config_name="config")
def main(cfg: DictConfig) -> None:
    """Run what the config says; in a multirun, go on with the others after one that failed."""
    # Launchers pickle this function by value, so that it must refer to nothing that has a lock.
    _job(cfg)


def _job(cfg: DictConfig) -> None:
    try:
        torch.set_num_threads(_threads(cfg.threads, HydraConfig.get().launcher))
        with locks.shared(_cache() / locks.FILE, _remove_partial_frames):
            if cfg.task is not None:
                with _exclusive(cfg):
                    hydra.utils.instantiate(cfg.task, _recursive_=False, _convert_="all")
            elif distributed.launched():
                _run_sharded(cfg, dict(HydraConfig.get().runtime.choices))
            else:
                run(cfg, dict(HydraConfig.get().runtime.choices))
    except locks.Held as held:
        console.print(str(held), style="yellow", markup=False, soft_wrap=True)
        sweep.note(sweep.LEFT, held.what)
    except Exception as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        _complain(error)
        if distributed.launched():
            sys.exit(1)  # the others wait for this rank, and torchrun ends them now
        if os.getpid() == _process:
            _failures.append(error)
        elif not sweep.note(sweep.FAILED, f"{_overrides()}: {type(error).__name__}: {error}"):
            raise


def run(
    cfg: DictConfig, choices: dict[str, str | None], start: Callable[[], None] = lambda: None
) -> dict[str, Any]:
    """Carry out one run, or find that it is finished; returns its record.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
        start: called when it is sure that there is something to do.

    Raises:
        locks.Held: if another process is at it.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    for key in record.NOT_IDENTITY:
        config.pop(key)
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(cfg.scene, "scene")
    fingerprint = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in ("scene", "model", "stop")}
    identity = record.run_id(names["scene"], names["model"], config, fingerprint)
    folder = record.results_dir() / "runs" / identity
    entry: dict[str, Any] = {
        "schema": record.SCHEMA,
        "id": identity,
        "status": "running",
        "command": record.command(),
        "choices": names,
        "experiment": choices.get("experiment"),
        "config": config,
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
    if known := _finished(folder, cfg.force):
        return known
    with locks.held(folder / locks.FILE):
        if known := _finished(folder, cfg.force):  # by now
            return known
        record.remove_leftovers(folder)
        with _exclusive(cfg), blas.limited(config["model"], config["threads"]) as libraries:
            entry["environment"] = {
                **record.environment(cfg.device, config["threads"], config),
                "exclusive": cfg.exclusive,
                "libraries": libraries,
            }
            _carry_out(cfg, scene, entry, folder, start)
    summarise(console, entry, folder)
    return entry


def _carry_out(
    cfg: DictConfig, scene: Scene, entry: dict[str, Any], folder: Path, start: Callable[[], None]
) -> None:
    """Train and test; the record says what came of it, and that it began if nothing can be said."""
    record.write_record(folder, entry)
    (folder / "curve.csv").unlink(missing_ok=True)  # of an earlier attempt
    curve: list[dict[str, float]] = []

    def write() -> None:
        if curve:
            record.write_curve(folder, curve)
        record.write_record(folder, entry)

    try:
        start()
        cache = _cache() if cfg.cache else None
        entry |= train_and_test(cfg, scene, entry["choices"], curve, cache, console)
        entry["status"] = "finished"
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()
        with suppress(OSError):  # on a full disk; what is raised is what happened first
            write()
        raise
    write()


def _run_sharded(cfg: DictConfig, choices: dict[str, str | None]) -> None:
    """:func:`run` on rank 0 of torchrun; the other ranks train their shards and write nothing."""
    distributed.join(cfg.device)
    cfg = copy.deepcopy(cfg)
    with open_dict(cfg):
        cfg.model = {
            "_target_": "experiments.distributed.Sharded",
            "model": cfg.model,
            "ranks": distributed.ranks(),
        }

    def lead(start: Callable[[], None]) -> None:
        def make_frames_and_start() -> None:
            if cfg.cache:  # by one rank, not by all
                data.cached(instantiate(cfg.scene, "scene"), _cache(), lambda *_: None)
            start()

        instantiate(cfg.model, "model")  # one line for a model that cannot, and no record
        run(cfg, choices, make_frames_and_start)

    def follow() -> None:
        scene, quiet = instantiate(cfg.scene, "scene"), Console(quiet=True)
        names = {key: str(name) for key, name in choices.items()}
        train_and_test(cfg, scene, names, [], _cache() if cfg.cache else None, quiet)

    distributed.together(lead, follow)


def _finished(folder: Path, force: bool) -> dict[str, Any] | None:
    """The record of a run that need not be repeated, after telling so."""
    known = record.read_record(folder)
    if force or not known or known["status"] != "finished":
        return None
    if any(folder.glob(".*")):  # a kill just after the end, or in a forced repetition
        with suppress(locks.Held), locks.held(folder / locks.FILE):
            record.remove_leftovers(folder)
    summarise(console, known, folder, repeated=True)
    return known


def _exclusive(cfg: DictConfig) -> AbstractContextManager[None]:
    """The cores to oneself, unless the config says otherwise."""
    n = torch.get_num_threads() * distributed.local_ranks()

    def waiting() -> None:
        console.print(
            f"waiting: {n} free cores expected, other runs are timed on them "
            "(exclusive=false runs beside them)",
            style="yellow",
            soft_wrap=True,
        )

    return cores.held(n, cfg.device, waiting) if cfg.exclusive else nullcontext()


def _cache() -> Path:
    return record.results_dir() / "cache"


def _remove_partial_frames() -> None:
    """What killed processes left of frames; for when no run is going on."""
    for path in _cache().glob("*.partial"):
        path.unlink(missing_ok=True)


def _threads(wanted: Any, launcher: Any) -> int:
    """Threads of torch: those asked for, or this worker's share of the cores."""
    if wanted is None:
        n = max(1, len(cores.available()) // distributed.local_ranks())
        workers = launcher.get("n_jobs") or 1  # of joblib, below zero for one a core
        share = launcher.get("cpus_per_task") or (n // workers if workers > 0 else 1)
        return min(n, max(1, share))
    if not isinstance(wanted, int) or isinstance(wanted, bool) or wanted < 1:
        raise ValueError(f"threads: expected an integer from 1, or null, found {wanted!r}")
    return wanted


def _overrides() -> str:
    """What makes this run of a sweep differ from the others, as a user would type it."""
    return " ".join(HydraConfig.get().overrides.task)


def _complain(error: BaseException) -> None:
    if isinstance(error, _USER_ERRORS):
        # Control characters in what an error quotes are shown, and no :emoji: is drawn.
        plain = (c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in str(error).strip())
        stderr.print("[red]error:[/red]", escape("".join(plain)), soft_wrap=True, emoji=False)
    else:
        traceback.print_exception(error)


def entry_point() -> None:
    """:func:`main`, with an error that is the user's shown as one line; exits with 1 after any."""
    global _process
    _process = os.getpid()
    sweep.begin()
    # A scheduler's or a user's end of a run is written into its record.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        main()
        distributed.leave()
    except KeyboardInterrupt:
        stderr.print("interrupted; the same command goes on")
        sys.exit(128 + signal.SIGINT)
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
