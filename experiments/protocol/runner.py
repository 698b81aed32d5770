"""The runner: a config becomes a task, its rows a record; or the record is found finished."""

from __future__ import annotations

import json
import os
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import msgspec
import torch
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import machine
from experiments.protocol.measure_run import Training
from experiments.protocol.settings import Carried, check_device, checked
from experiments.protocol.task import Context, Row, Task, named
from experiments.records import configs, locks, store
from experiments.records.environment import COMMAND, Environment, environment
from experiments.records.files import results_dir
from experiments.records.record import SCHEMA, Named, Record, name_of
from experiments.records.revision import revisions
from experiments.records.rows import Rows

Config = Mapping[str, Any]
_ERROR_CHARACTERS = 2000
# Keys of a training's config that say how it is carried out or shown, not what it computes.
NOT_IDENTITY = (
    *("force", "cache", "exclusive", "task", "beside", "display", "scene_display"),
    *("disturbed", "sessions"),  # the latter: what the scene has in itself
)
_OF_MODEL = ("model.", "stop.")  # keys of what was changed of a model, not of a scene
# Keys that say which frames there are, and which of them test.
_OF_FRAMES = ("scene.", "split.", "old_split.")
_ORDER = {"scene": 0, "split": 1, "model": 2, "stop": 3}  # of what was changed
_NO_CHANGE = ("device", "threads")


@dataclass(frozen=True)
class Asked:
    """The choices and settings of the command line.

    Attributes:
        choices: name of the file that each group of ``configs/`` was composed from.
        keys: dotted, that the command line or the experiment's file set.
    """

    choices: Mapping[str, str | None]
    keys: Sequence[str] = ()

    def of(self, group: str) -> str:
        """The name of a group's file; ``custom`` where it has none."""
        return self.choices.get(group) or "custom"


def carry_out(config: Config, asked: Asked, console: Console) -> tuple[Record, bool]:
    """Carry out what a config asks for, or find that it is finished.

    Args:
        config: the whole, resolved.
        asked: choices and settings of the command line.
        console: shows the progress.

    Returns:
        tuple: the record, and whether it was there already.

    Raises:
        locks.Held: if another process is at it.
        ValueError: if the config is wrong; the key is named.
    """
    how = checked(config, Carried)
    check_device("device", how.device)
    task, own = _task(config)
    threads, folder = torch.get_num_threads(), results_dir()
    here = environment(how.device, threads)
    here.exclusive = how.exclusive
    begun = _begun(task, own, config, asked, here)

    def known(console: Console | None = None) -> Record | None:
        """The finished record, if today's code would make the same."""
        if how.force:
            return None
        columns = [f"beside.{name}_s" for name in getattr(task, "beside", ())]
        same = threads if task.timed else None
        now = begun.revisions
        return store.made_before(folder, begun.id, now, console, same, columns)

    found = known()
    if found is not None:
        return found, True
    with locks.held(store.lock_of(folder, begun.id), begun.id):
        found = known(console)  # another process may have finished it since
        if found is not None:
            return found, True
        held = machine.held(threads, how.device, console)
        alone: AbstractContextManager[None] = held if how.exclusive else nullcontext()
        with alone, machine.limited(own, threads):
            return _made(task, begun, how, console, folder), False


def _task(config: Config) -> tuple[Task, dict[str, Any]]:
    """The task of a config, and what determines its rows."""
    if config["task"] is None:
        own = {k: v for k, v in config.items() if k not in NOT_IDENTITY}
        own["threads"] = torch.get_num_threads()
        return checked(config, Training), own
    kind = named(config["task"])
    given = configs.without(("display",), config["task"])
    given.pop("_target_")
    task = checked(given, kind, "task")
    own = {}
    for one in msgspec.structs.fields(kind):
        default = list(one.default) if isinstance(one.default, tuple) else one.default
        own[one.name] = given.get(one.name, default)
    return task, own


def _begun(
    task: Task, own: dict[str, Any], config: Config, asked: Asked, here: Environment
) -> Record:
    """The record before anything is made."""
    of_task = _of_training if isinstance(task, Training) else _of_experiment
    name, about = of_task(task, own, config, asked)
    if own.get("scene") is not None:
        scene = asked.of("scene")
        about["scene"] = Named(scene, scene, config.get("scene_display") or {})
    data, changed = task.fingerprint(), _changed(own, asked.keys)
    device, determining = config["device"], own
    if device != "cpu":  # its times do not compare
        determining = {**own, "device": device}
        changed["model.device"] = json.dumps(device)
    return Record(
        schema=SCHEMA,
        id=name_of(name, determining, data),
        config=own,
        changed=changed,
        timed=task.timed,
        command=os.environ.get(COMMAND, ""),
        data=data,
        environment=here,
        status="interrupted",
        **about,
    )


def _of_training(
    task: Task, own: Config, config: Config, asked: Asked
) -> tuple[str, dict[str, Any]]:
    """Start of the id of a training, and what its record says of it."""
    model = asked.of("model")
    return f"{asked.of('scene')}-{model}", {
        "experiment": asked.choices.get("experiment") or "",
        "model": Named(model, model, config.get("display") or {}),
        "stop": asked.of("stop"),
        "revisions": revisions(own),
    }


def _of_experiment(
    task: Task, own: Config, config: Config, asked: Asked
) -> tuple[str, dict[str, Any]]:
    """Start of the id of another experiment, and what its record says of it."""
    kind = type(task)
    name = asked.choices.get("experiment") or kind.__name__
    target = f"{kind.__module__}.{kind.__qualname__}"
    made_by = revisions({"_target_": target, **own})
    return name, {"experiment": name, "task": target, "revisions": made_by}


def _changed(own: Config, keys: Sequence[str]) -> dict[str, str]:
    """Values that were set, as JSON by dotted key: of frames first, then of the model."""
    values, found = OmegaConf.create(dict(own)), {}
    for key in keys:
        key = key.removeprefix("task.")
        group, _, rest = key.partition(".")
        is_part = group in own and (rest or not isinstance(own[group], Mapping))
        is_seed = key.rpartition(".")[2] in configs.SEEDS or group == "seed"
        if is_part and not is_seed and key not in (*configs.COORDINATES, *_NO_CHANGE):
            value = OmegaConf.select(values, key)
            found[key] = json.dumps(value, default=OmegaConf.to_object)
    ordered = sorted(found, key=lambda key: _ORDER.get(key.partition(".")[0], 9))
    return {key: found[key] for key in ordered}


def _made(
    task: Task, begun: Record, how: Carried, console: Console, folder: Path
) -> Record:
    """Carry out a task and add its record; one that breaks off is recorded as far as it came."""
    name = begun.model.name if begun.model else begun.experiment
    context = Context(name, how.cache, how.force, console, begun)
    rows: list[Row] = []
    start = time.perf_counter()
    try:
        for row in task.rows(context):
            rows.append(row)  # noqa: PERF402  (as far as they come)
        seconds = time.perf_counter() - start
        done = _ended(begun, rows, status="finished", seconds=seconds)
    except BaseException as error:
        text = "".join(traceback.format_exception_only(error)).strip()
        status = "failed" if isinstance(error, Exception) else "interrupted"
        # On a full disk, or where rows are no JSON, the first error is the one to see.
        with suppress(OSError, TypeError):
            broken = _ended(begun, rows, status=status, error=text[:_ERROR_CHARACTERS])
            store.append(folder, broken)
        raise
    store.append(folder, done)
    return done


def _ended(begun: Record, rows: Sequence[Row], **ended: Any) -> Record:
    """The record with its rows, and the labels of its scene and model.

    Raises:
        ValueError: for predictions that are no classes.
        TypeError: for rows that JSON does not have.
    """
    changed, scene, model = begun.changed, begun.scene, begun.model
    if not any("loss" in row for row in rows):
        # What learns in one pass ends by itself, whatever the rule.
        changed = {k: v for k, v in changed.items() if not k.startswith("stop.")}
    if model:
        model = _labelled(model, model.name, changed, _OF_MODEL)
    if scene:
        name = scene.name
        if name == "recorded":  # whatever the name of the file, by what is in it
            path = PurePath(begun.config["scene"]["path"])
            name += f" {path.name} ({begun.data[:6]})"
        scene = _labelled(scene, name, changed, _OF_FRAMES)
    about = {"changed": changed, "scene": scene, "model": model, "rows": Rows.of(rows)}
    return msgspec.structs.replace(begun, **about, **ended)


def _labelled(
    part: Named, name: str, changed: Mapping[str, str], starts: tuple[str, ...]
) -> Named:
    """A scene or a model with its label: a name, and in brackets what was changed of it."""
    values = [
        f"{key.partition('.')[2]}={value}"
        for key, value in changed.items()
        if key.startswith(starts)
    ]
    label = f"{name} ({', '.join(values)})" if values else name
    return msgspec.structs.replace(part, label=label)
