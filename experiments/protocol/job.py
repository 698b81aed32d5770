"""One config, one record: a run is carried out, or found finished."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf
from rich.console import Console

from experiments.protocol import machine
from experiments.protocol.model import instantiate
from experiments.protocol.trial import train_and_test
from experiments.records import configs, locks
from experiments.records import record as records
from experiments.records.environment import command, environment
from experiments.records.files import results_dir
from experiments.records.record import Finished
from scenes.frames import Scene

_ERROR_CHARACTERS = 2000


def check(cfg: DictConfig) -> None:
    """Refuse what can be known to be wrong before anything is built.

    Raises:
        ValueError: naming the key, what was expected and what was found.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    for key, value in _leaves(OmegaConf.to_container(cfg, resolve=True)):
        if value != value:  # only nan is unlike itself
            raise ValueError(f"{key}: expected a number, found nan")
    for key in ("exclusive", "cache", "force"):
        if not isinstance(cfg[key], bool):
            raise ValueError(f"{key}: expected true or false, found {cfg[key]!r}")
    for key, seed in cfg.seed.items():
        if type(seed) is not int or not 0 <= seed <= 2**53:
            raise ValueError(
                f"seed.{key}: expected an integer from 0 to 2^53, found {seed!r}"
            )
    for key in ("device", "model.device"):
        name = OmegaConf.select(cfg, key, default="cpu")
        try:
            torch.empty(0, device=torch.device(name)).cpu()
        except (RuntimeError, AssertionError, NotImplementedError, TypeError) as error:
            there = ", ".join(
                ["cpu", *(f"cuda:{k}" for k in range(torch.cuda.device_count()))]
            )
            raise ValueError(
                f"{key}: expected one of {there}, found {name!r}"
            ) from error


def _leaves(node: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """(dotted key, value) of everything in a resolved config that is no mapping."""
    if not isinstance(node, Mapping):
        yield key, node
        return
    for name, value in node.items():
        yield from _leaves(value, f"{key}.{name}".lstrip("."))


def _check_kinds(config: Mapping[str, Any], group: str, name: str | None) -> None:
    """Refuse a text where the file of ``configs/`` has a number: models fail of it late, or not."""
    known = configs.part(group, name or "")
    expected = dict(_leaves(known[group], group)) if known else {}
    for key, value in _leaves(config[group], group):
        if type(expected.get(key)) in (int, float) and isinstance(value, str):
            raise ValueError(f"{key}: expected a number, found {value!r}")


def run(
    cfg: DictConfig,
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
    console: Console,
) -> tuple[Finished, bool]:
    """Carry out one run, or find that it is finished.

    Args:
        cfg: the composed config.
        choices: which file of each group it was composed from, for names.
        overrides: what was set on the command line, for the record.
        console: shows the progress.

    Returns:
        tuple: the record, and whether it was there already.

    Raises:
        locks.Held: if another process is at it.
        ValueError: if the config is wrong; the key is named.
    """
    check(cfg)
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    for group in ("scene", "model"):
        _check_kinds(config, group, choices.get(group))
    display = config.get("display") or {}
    for key in records.NOT_IDENTITY:
        config.pop(key, None)
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(cfg.scene, "scene")
    fingerprint = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in ("scene", "model", "stop")}
    identity = records.run_id(names["scene"], names["model"], config, fingerprint)
    entry: dict[str, Any] = {
        "schema": records.SCHEMA,
        "id": identity,
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
            "saturated": str(getattr(scene, "saturated", "") or ""),
        },
    }
    folder = results_dir()
    if not cfg.force and (known := records.find(folder, identity)):
        return known, True
    with locks.held(folder / "cache" / "locks" / identity, identity):
        if not cfg.force and (
            known := records.find(folder, identity)
        ):  # finished meanwhile
            return known, True
        with (
            exclusive(cfg, console),
            machine.libraries(config["model"], config["threads"]) as libraries,
        ):
            entry["environment"] = {
                **environment(cfg.device, config["threads"], config),
                "exclusive": cfg.exclusive,
                "libraries": libraries,
            }
            _carry_out(cfg, scene, entry, folder, console)
    done = records.find(folder, identity)
    assert done is not None
    return done, False


def exclusive(cfg: DictConfig, console: Console) -> AbstractContextManager[None]:
    """The machine to oneself, unless the config says otherwise."""
    n = torch.get_num_threads()

    def waiting() -> None:
        text = f"waiting for {n} free cores: another run is timed (exclusive=false runs beside it)"
        console.print(text, style="yellow", soft_wrap=True)

    return machine.held(n, cfg.device, waiting) if cfg.exclusive else nullcontext()


def _carry_out(
    cfg: DictConfig, scene: Scene, entry: dict[str, Any], folder: Path, console: Console
) -> None:
    """Train and test, and add the record; a run that fails is recorded with its error."""
    curve: records.Curve = []
    records.to_line(
        entry, curve
    )  # a record that cannot be written is found before the training
    try:
        cache = folder / "cache" if cfg.cache else None
        train_and_test(cfg, scene, entry["choices"], curve, entry, cache, console)
        entry["status"] = "finished"
        classes = len(scene.classes)
        for label in entry["predicted"]:
            if not 0 <= label < classes:
                raise ValueError(
                    f"predicted: expected labels below {classes}, found {label}"
                )
    except BaseException as error:
        entry["status"] = "failed" if isinstance(error, Exception) else "interrupted"
        text = "".join(traceback.format_exception_only(error)).strip()
        entry["error"] = text[:_ERROR_CHARACTERS]
        with suppress(
            OSError, TypeError
        ):  # on a full disk the first error is the one to see
            records.append(folder, entry, curve)
        raise
    records.append(folder, entry, curve)
