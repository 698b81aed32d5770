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
from experiments.records import configs, locks, store
from experiments.records.environment import command, environment
from experiments.records.files import results_dir
from experiments.records.record import (
    NOT_IDENTITY,
    SCHEMA,
    name_of,
    to_line,
)
from experiments.records.revision import Revisions, revisions
from experiments.records.rows import Rows
from experiments.records.run import (
    COORDINATES,
    Choices,
    Finished,
    RunRecord,
    SceneOf,
    Unfinished,
)
from scenes.frames import Scene

_ERROR_CHARACTERS = 2000
# Of a record, once its run has ended.
_ENDED = ("status", "error", "training_s", "rows")
_OF_FILES = ("scene", "model", "stop")  # groups of configs/ that make a run
# Keys that say which run of a config it is, or how it is carried out; those below `seed` besides.
_NO_CHANGE = (
    *(*_OF_FILES, "experiment", *COORDINATES),
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
    display, scene_display = config.get("display"), config.get("scene_display")
    config = {k: v for k, v in config.items() if k not in NOT_IDENTITY}
    config["threads"] = torch.get_num_threads()
    scene: Scene = instantiate(settings.scene, "scene")
    data = scene.fingerprint()
    names = {key: choices.get(key) or "custom" for key in _OF_FILES}
    identity = name_of(f"{names['scene']}-{names['model']}", config, data)
    folder, now = results_dir(), revisions(config)
    known = _finished(folder, identity, now, settings)
    if known is not None:
        return known, True
    with locks.held(store.lock_of(folder, identity), identity):
        # Another process may have finished it since.
        known = _finished(folder, identity, now, settings, console)
        if known is not None:
            return known, True
        libraries_of = machine.libraries(config["model"], config["threads"])
        with exclusive(settings, console), libraries_of as libraries:
            of_machine = environment(settings.device, config["threads"])
            of_machine.exclusive = settings.exclusive
            of_machine.libraries = libraries
            begun = Unfinished(
                schema=SCHEMA,
                id=identity,
                command=command(),
                config=config,
                changed=changed_keys(config, choices, overrides),
                data=data,
                revisions=now,
                environment=of_machine,
                choices=Choices(**names),
                scene=_scene_of(scene, names["scene"]),
                experiment=choices.get("experiment"),
                overrides=list(overrides),
                display=display or {},
                scene_display=scene_display or {},
                status="interrupted",
            )
            cache = folder / "cache" if settings.cache else None
            trials = train_and_test(settings, scene, names["model"], cache, console)
            return _carry_out(trials, begun, folder), False


def _finished(
    folder: Path,
    identity: str,
    now: Revisions,
    settings: Settings,
    console: Console | None = None,
) -> Finished | None:
    """The finished record of a run, if today's code made it and trained the models beside it that
    are asked for; if not, that is said."""
    known = store.made_before(folder, identity, now, settings.force, console)
    if not isinstance(known, Finished):
        return None
    missing = sorted(settings.beside.keys() - known.beside_s.keys())
    if missing and console is not None:
        text = f"{identity}: made again, to train {', '.join(missing)} beside it"
        console.print(text, style="yellow", markup=False, soft_wrap=True)
    return None if missing else known


def _scene_of(scene: Scene, name: str) -> SceneOf:
    height, width = scene.shape
    return SceneOf(
        name=name,
        origin=scene.origin,
        classes=list(scene.classes),
        shape=(height, width),
        n=len(scene.labels),
        saturated=str(getattr(scene, "saturated", "") or ""),
    )


def changed_keys(
    config: Mapping[str, Any],
    choices: Mapping[str, str | None],
    overrides: Sequence[str],
) -> dict[str, str]:
    """Values of scene, split, model and stopping rule that are not those of the files chosen.

    Values by dotted key, as JSON, but for seeds and for what a row asks for by number
    (:data:`experiments.records.run.COORDINATES`). A scene or a model in no file has those that the
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
            changed = _changed_of(group, config, choices.get(group) or "", typed)
            found |= {k: v for k, v in changed.items() if k not in COORDINATES}
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
    begun: Unfinished,
    folder: Path,
) -> Finished:
    """Carry out a trial and add its record; one that breaks off is recorded as far as it came."""
    trial = Trial()
    # A record that cannot be written is found before the training.
    to_line(begun)
    try:
        for reached in trials:
            trial = reached
        done = finished(begun, trial)
        to_line(done)  # predictions that are none fail here
    except BaseException as error:
        text = "".join(traceback.format_exception_only(error)).strip()
        begun.status = "failed" if isinstance(error, Exception) else "interrupted"
        begun.error = text[:_ERROR_CHARACTERS]
        begun.stop, begun.training_s = trial.stop, trial.training_s
        begun.rows = Rows.of_curve(trial.curve)
        # On a full disk the first error is the one to see.
        with suppress(OSError):
            store.append(folder, begun)
        raise
    store.append(folder, done)
    return done


def finished(begun: Unfinished, trial: Trial) -> Finished:
    """The record of a run whose trial came to its end.

    Raises:
        ValueError: for predictions that are no classes.
    """
    own = {f: getattr(begun, f) for f in RunRecord.__struct_fields__}
    of_run = {key: value for key, value in own.items() if key not in _ENDED}
    return Finished(
        **of_run,
        stop=trial.stop or "",
        training_s=trial.training_s or 0.0,
        rows=Rows.of_curve(trial.curve),
        **trial.results,
    )
