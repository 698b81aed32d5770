"""One config, one record: a run is carried out, or found finished."""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console

from experiments.protocol import machine
from experiments.protocol.model import instantiate
from experiments.protocol.settings import Settings, check_arguments, checked, leaves
from experiments.protocol.trial import train_and_test
from experiments.records import configs, locks, steps
from experiments.records import record as records
from experiments.records.environment import command, environment
from experiments.records.files import results_dir
from experiments.records.record import Finished
from experiments.records.revision import revisions
from scenes.frames import Scene

_ERROR_CHARACTERS = 2000
_OF_FILES = ("scene", "model", "stop")  # groups of configs/ that make a run
# Keys that say which run of a config it is, or how it is carried out; those below `seed` besides.
_NO_CHANGE = (
    *(*_OF_FILES, "experiment", "split.n_train", "data.pixels", "scene.path"),
    *("device", "threads", "exclusive", "cache", "force"),
)


def check(cfg: DictConfig) -> None:
    """Refuse what can be known to be wrong before anything is built.

    Raises:
        ValueError: naming the key, what was expected and what was found.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    for key, value in leaves(config):
        if value != value:  # only nan is unlike itself
            raise ValueError(f"{key}: expected a number, found nan")
    checked(config, Settings)
    for group in ("scene", "model"):
        check_arguments(config.get(group), group)
    for key in ("device", "model.device"):
        _check_device(key, OmegaConf.select(cfg, key, default="cpu"))


def _check_device(key: str, name: Any) -> None:
    try:
        torch.empty(0, device=torch.device(name)).cpu()
    # Torch raises each of these: of no name, an unknown device, one that is lacking, "meta".
    except (RuntimeError, AssertionError, NotImplementedError, TypeError) as error:
        gpus = [f"cuda:{k}" for k in range(torch.cuda.device_count())]
        there = ", ".join(["cpu", *gpus])
        raise ValueError(f"{key}: expected one of {there}, found {name!r}") from error


def run(
    cfg: DictConfig,
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
    console: Console,
    about: str = "",
) -> tuple[Finished, bool]:
    """Carry out one run, or find that it is finished.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
        overrides: what was set on the command line, for the record.
        console: shows the progress.
        about: what stands before it.

    Returns:
        tuple: the record, and whether it was there already.

    Raises:
        locks.Held: if another process is at it.
        ValueError: if the config is wrong; the key is named.
    """
    check(cfg)
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    displays = {key: config.get(key) or {} for key in ("display", "scene_display")}
    for key in records.NOT_IDENTITY:
        config.pop(key, None)
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(cfg.scene, "scene")
    data = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in _OF_FILES}
    identity = records.run_id(names["scene"], names["model"], config, data)
    steps.add(identity)
    entry: dict[str, Any] = {
        "schema": records.SCHEMA,
        "id": identity,
        "command": command(),
        "choices": names,
        "experiment": choices.get("experiment"),
        "overrides": list(overrides),
        **displays,
        "config": config,
        "data": data,
        "scene": {
            "name": names["scene"],
            "origin": scene.origin,
            "classes": list(scene.classes),
            "shape": list(scene.shape),
            "n": len(scene.labels),
            "saturated": str(getattr(scene, "saturated", "") or ""),
        },
    }
    folder = results_dir()
    known = _finished(folder, identity, cfg.force)
    if known is not None:
        return known, True
    with locks.held(folder / "cache" / "locks" / identity, identity):
        # Another process may have finished it since.
        known = _finished(folder, identity, cfg.force, console)
        if known is not None:
            return known, True
        entry["revisions"] = revisions(config)
        entry["changed"] = changed_keys(config, choices, overrides)
        libraries_of = machine.libraries(config["model"], config["threads"])
        with exclusive(cfg, console), libraries_of as libraries:
            entry["environment"] = {
                **environment(cfg.device, config["threads"]),
                "exclusive": cfg.exclusive,
                "libraries": libraries,
            }
            _carry_out(cfg, scene, entry, folder, console, about)
    done = records.find(folder, identity)
    assert done is not None
    return done, False


def _finished(
    folder: Path,
    identity: str,
    force: bool,
    console: Console | None = None,
) -> Finished | None:
    """The finished record of a run, if today's code made it; if another did, that is said."""
    known = None if force else records.find(folder, identity)
    if known is None:
        return None
    reasons = known.outdated
    if not reasons:
        return known
    if console is not None:
        text = f"{identity}: run again, finished by other code: {', '.join(reasons)}"
        console.print(
            text,
            style="yellow",
            markup=False,
            soft_wrap=True,
        )
    return None


def changed_keys(
    config: Mapping[str, Any],
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
) -> dict[str, str]:
    """Values of scene, split, model and stopping rule that are not those of the files chosen.

    By dotted key, as JSON, but for seeds. Of a scene or a model that is in no file, those that the
    command line has.

    Args:
        config: the whole, resolved.
        choices: which file of each group it was composed from.
        overrides: words of the command line.
    """
    found: dict[str, str] = {}
    typed = {}
    for word in overrides:
        key, _, value = word.lstrip("+~").partition("=")
        if key not in _NO_CHANGE and not key.startswith(("seed.", "hydra")):
            typed[key] = value
    if typed or choices.get("experiment"):
        for group in _OF_FILES:
            found |= _changed_of(group, config, choices.get(group) or "", typed)
    if config["device"] != "cpu":  # its times do not compare
        found["model.device"] = config["device"]
    return found


def _changed_of(
    group: str,
    config: Mapping[str, Any],
    name: str,
    typed: Mapping[str, str],
) -> dict[str, str]:
    keys = ("scene", "split") if group == "scene" else (group,)
    of_files = configs.part(group, name)
    if of_files is None:
        below = {key: value for key, value in typed.items() if "." in key}
        return {k: v for k, v in below.items() if k.partition(".")[0] in keys}
    same = (*configs.SEEDS, "device")
    ours = configs.without(same, {key: config.get(key) for key in keys})
    return configs.differences(ours, configs.without(same, of_files))


def exclusive(cfg: DictConfig, console: Console) -> AbstractContextManager[None]:
    """The machine to oneself, unless the config says otherwise."""
    if not cfg.exclusive:
        return nullcontext()
    n = torch.get_num_threads()

    def waiting() -> None:
        text = f"waiting for {n} free cores: another run is timed (exclusive=false runs beside it)"
        console.print(text, style="yellow", soft_wrap=True)

    return machine.held(n, cfg.device, waiting)


def _carry_out(
    cfg: DictConfig,
    scene: Scene,
    entry: dict[str, Any],
    folder: Path,
    console: Console,
    about: str,
) -> None:
    """Train and test, and add the record; a run that fails is recorded with its error."""
    curve: records.Curve = []
    # A record that cannot be written is found before the training.
    records.to_line(entry, curve)
    try:
        cache = folder / "cache" if cfg.cache else None
        choices = entry["choices"]
        train_and_test(cfg, scene, choices, curve, entry, cache, console, about)
        entry["status"] = "finished"
        _check_labels(entry["predicted"], len(scene.classes))
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        text = "".join(traceback.format_exception_only(error)).strip()
        entry["error"] = text[:_ERROR_CHARACTERS]
        # On a full disk, or with labels that are none, the first error is the one to see.
        with suppress(OSError, TypeError):
            records.append(folder, entry, curve)
        raise
    records.append(folder, entry, curve)


def _check_labels(predicted: Sequence[int], classes: int) -> None:
    for label in predicted:
        if not 0 <= label < classes:
            raise ValueError(
                f"predicted: expected labels below {classes}, found {label}"
            )
