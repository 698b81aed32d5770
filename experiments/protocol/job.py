"""One config, one record: a run is carried out, or found finished."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console

from experiments.protocol import machine
from experiments.protocol.trial import instantiate, train_and_test
from experiments.records import configs, locks
from experiments.records import record as records
from experiments.records.environment import command, cpu_model, environment
from experiments.records.files import remove_leftovers, results_dir
from experiments.records.record import Finished
from experiments.records.results import Run
from experiments.records.sources import outdated
from experiments.records.timing import unlike_siblings
from scenes.frames import Scene

_SWITCHES = ("exclusive", "cache", "force")
_MOST_ERROR = 2000  # characters of an error that a record keeps


def check(cfg: DictConfig) -> None:
    """Refuse what can be known to be wrong before anything is built.

    Raises:
        ValueError: naming the key, what was expected and what was found.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    for key in _SWITCHES:
        if not isinstance(cfg[key], bool):
            raise ValueError(f"{key}: expected true or false, found {cfg[key]!r}")
    for key, seed in cfg.seed.items():
        if not isinstance(seed, int) or isinstance(seed, bool) or abs(seed) > 2**53:
            raise ValueError(f"seed.{key}: expected an integer of at most 2^53, found {seed!r}")
    try:
        torch.empty(0, device=torch.device(cfg.device)).cpu()
    except (RuntimeError, AssertionError, NotImplementedError, TypeError, ValueError) as error:
        there = ["cpu", *(f"cuda:{k}" for k in range(torch.cuda.device_count()))]
        raise ValueError(
            f"device: expected one of {', '.join(there)}, found {cfg.device!r}"
        ) from error


def _check_kinds(part: DictConfig, group: str, name: str | None) -> None:
    """Refuse a text where the file of ``configs/`` has a number: models fail of it late, or not."""
    path = configs.CONFIGS / group / f"{name}.yaml"
    if not path.is_file():
        return
    tree: Any = OmegaConf.to_container(OmegaConf.load(path))
    found = OmegaConf.to_container(part, resolve=True)
    for key, value, ours in configs.beside(found, tree.get(group, tree), group):
        number = type(ours) in (int, float) or str(ours).startswith("${seed.")
        if number and isinstance(value, str) and value != "???":
            raise ValueError(f"{key}: expected a number, found {value!r}")


def run(
    cfg: DictConfig,
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
    console: Console,
    start: Callable[[], None] = lambda: None,
) -> tuple[Finished, Path, bool]:
    """Carry out one run, or find that it is finished.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
        overrides: what was set on the command line, for the record.
        console: shows the progress.
        start: called when it is sure that there is something to do.

    Returns:
        tuple: the record, its folder, and whether it was there already.

    Raises:
        locks.Held: if another process is at it.
        ValueError: if the config, or the record that is there, is wrong; the key or file is named.
    """
    check(cfg)
    for group in ("scene", "model"):
        _check_kinds(cfg[group], group, choices.get(group))
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    display = config.get("display") or {}
    for key in records.NOT_IDENTITY:
        config.pop(key, None)
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(cfg.scene, "scene")
    fingerprint = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in ("scene", "model", "stop")}
    identity = records.run_id(names["scene"], names["model"], config, fingerprint)
    folder = results_dir() / "runs" / identity
    entry: dict[str, Any] = {
        "schema": records.SCHEMA,
        "id": identity,
        "status": "running",
        "command": command(),
        "choices": names,
        "experiment": choices.get("experiment"),
        "overrides": list(overrides),
        "display": display,
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
    known = _finished(folder, cfg.force)
    if known and not (again := _disturbed(folder, known)):
        return known, folder, True
    with locks.held(folder / locks.FILE):
        known = _finished(folder, cfg.force)  # by now
        if known and not (again := _disturbed(folder, known)):
            return known, folder, True
        if known and again:
            entry["timed_again"] = known.training_s
        remove_leftovers(folder)
        with (
            exclusive(cfg, console),
            machine.libraries(config["model"], config["threads"]) as libraries,
        ):
            entry["environment"] = {
                **environment(cfg.device, config["threads"], config),
                "exclusive": cfg.exclusive,
                "libraries": libraries,
            }
            _carry_out(cfg, scene, entry, folder, console, start)
    done = records.read_record(folder)
    assert isinstance(done, Finished)
    return done, folder, False


def exclusive(cfg: DictConfig, console: Console) -> AbstractContextManager[None]:
    """The cores to oneself, unless the config says otherwise."""
    n = torch.get_num_threads()

    def waiting() -> None:
        console.print(
            f"waiting: {n} free cores expected, other runs are timed on them "
            "(exclusive=false runs beside them)",
            style="yellow",
            soft_wrap=True,
        )

    return machine.held(n, cfg.device, waiting) if cfg.exclusive else nullcontext()


def cache_dir() -> Path:
    """Folder of made frames."""
    return results_dir() / "cache"


def _finished(folder: Path, force: bool) -> Finished | None:
    """The record of a run that need not be repeated.

    Raises:
        ValueError: if there is a file that is no record.
    """
    if force:
        return None
    try:
        known = records.read_record(folder)
    except ValueError as error:
        raise ValueError(f"{error} (force=true runs it again)") from error
    if not isinstance(known, Finished):
        return None
    if any(folder.glob(".*.*")):  # a kill just after the end, or in a forced repetition
        with suppress(locks.Held), locks.held(folder / locks.FILE):
            remove_leftovers(folder)
    return known


def _disturbed(folder: Path, known: Finished) -> bool:
    """Whether a finished run took unlike as long as its siblings, here and by the code as it is,
    and was not made again for that before."""
    made = known.environment
    if known.timed_again is not None or made.cpu != cpu_model() or outdated(made.sources):
        return False
    alike = []
    for path in folder.parent.glob(f"{known.choices.scene}-{known.choices.model}-*"):
        with suppress(ValueError):  # which costs that record, and the report names it
            other = records.read_record(path)
            if isinstance(other, Finished):
                alike.append(Run(other, records.read_curve(path / "curve.csv"), {}))
    return any(run.record.id == known.id for run in unlike_siblings(alike))


def _carry_out(
    cfg: DictConfig,
    scene: Scene,
    entry: dict[str, Any],
    folder: Path,
    console: Console,
    start: Callable[[], None],
) -> None:
    """Train and test; the record says what came of it, and that it began if nothing can be said."""
    records.from_json(records.to_json(entry))  # what could not be read again is not begun
    records.write_record(folder, entry)
    (folder / "curve.csv").unlink(missing_ok=True)  # of an earlier attempt
    curve: list[dict[str, float]] = []

    def write() -> None:
        if curve:
            records.write_curve(folder, curve)
        records.write_record(folder, entry)

    try:
        start()
        cache = cache_dir() if cfg.cache else None
        train_and_test(cfg, scene, entry["choices"], curve, entry, cache, console)
        entry["status"] = "finished"
        records.from_json(records.to_json(entry))  # nor kept as finished: the model's own labels
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        entry["error"] = "".join(traceback.format_exception_only(error)).strip()[:_MOST_ERROR]
        with suppress(OSError):  # on a full disk; what is raised is what happened first
            write()
        raise
    write()
