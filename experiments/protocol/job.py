"""One config, one record: a run is carried out, or found finished."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from experiments.protocol import machine
from experiments.protocol.model import instantiate
from experiments.protocol.settings import Settings, settings_of
from experiments.protocol.train_test import train_and_test
from experiments.protocol.trial import Trial
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


def run(
    config: Mapping[str, Any],
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
    console: Console,
) -> tuple[Finished, bool]:
    """Carry out one run, or find that it is finished.

    Args:
        config: the whole, resolved.
        choices: which file of each group it was composed from, for names.
        overrides: what was set on the command line, for the record.
        console: shows the progress.

    Returns:
        tuple: the record, and whether it was there already.

    Raises:
        locks.Held: if another process is at it.
        ValueError: if the config is wrong; the key is named.
    """
    settings = settings_of(config)
    displays = {key: config.get(key) or {} for key in ("display", "scene_display")}
    config = {k: v for k, v in config.items() if k not in records.NOT_IDENTITY}
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(settings.scene, "scene")
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
    known = _finished(folder, identity, settings.force)
    if known is not None:
        return known, True
    with locks.held(folder / "cache" / "locks" / identity, identity):
        # Another process may have finished it since.
        known = _finished(folder, identity, settings.force, console)
        if known is not None:
            return known, True
        entry["revisions"] = revisions(config)
        entry["changed"] = changed_keys(config, choices, overrides)
        libraries_of = machine.libraries(config["model"], config["threads"])
        with exclusive(settings, console), libraries_of as libraries:
            entry["environment"] = {
                **environment(settings.device, config["threads"]),
                "exclusive": settings.exclusive,
                "libraries": libraries,
            }
            cache = folder / "cache" if settings.cache else None
            trials = train_and_test(settings, scene, names["model"], cache, console)
            _carry_out(trials, entry, folder)
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


def exclusive(settings: Settings, console: Console) -> AbstractContextManager[None]:
    """The machine to oneself, unless the config says otherwise."""
    if not settings.exclusive:
        return nullcontext()
    n = torch.get_num_threads()

    def waiting() -> None:
        text = f"waiting for {n} free cores: another run is timed (exclusive=false runs beside it)"
        console.print(text, style="yellow", soft_wrap=True)

    return machine.held(n, settings.device, waiting)


def _carry_out(
    trials: Iterator[Trial],
    entry: dict[str, Any],
    folder: Path,
) -> None:
    """Carry out a trial and add its record; one that breaks off is recorded as far as it came."""
    trial = Trial()
    # A record that cannot be written is found before the training.
    records.to_line(entry, [])
    try:
        for reached in trials:
            trial = reached
        _check_labels(trial.results()["predicted"], len(entry["scene"]["classes"]))
    except BaseException as error:
        status = "failed" if isinstance(error, Exception) else "interrupted"
        text = "".join(traceback.format_exception_only(error)).strip()
        ended = {"status": status, "error": text[:_ERROR_CHARACTERS]}
        # On a full disk, or with labels that are none, the first error is the one to see.
        with suppress(OSError, TypeError):
            records.append(
                folder, {**entry, **trial.results(), **ended}, list(trial.curve)
            )
        raise
    ended = {"status": "finished"}
    records.append(folder, {**entry, **trial.results(), **ended}, list(trial.curve))


def _check_labels(predicted: Sequence[int], classes: int) -> None:
    for label in predicted:
        if not 0 <= label < classes:
            raise ValueError(
                f"predicted: expected labels below {classes}, found {label}"
            )
