"""Experiments that are more than a run: a generator of typed rows, and everything around it."""

from __future__ import annotations

import functools
import inspect
import sys
import time
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard

import msgspec
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.model import instantiate
from experiments.protocol.settings import checked
from experiments.records import configs, locks, store
from experiments.records.environment import command, environment
from experiments.records.files import results_dir
from experiments.records.record import SCHEMA, Measurement, name_of
from experiments.records.revision import revisions
from experiments.records.rows import Row, Rows
from scenes.frames import Scene

__all__ = ["Row", "Run", "experiment"]

_DRAWN = "scenes.sensor."  # scenes that their config determines: no file is read


@dataclass(eq=False)
class Run:
    """One call of an experiment: how its rows are made; no row depends on it.

    Attributes:
        name: name of the measurement.
        config: bound arguments of the experiment, with its ``_target_``.
        scene_name: name of the scene's config, where it has one.
        device: as torch names it.
        cache: keep frames on disk.
        force: make everything again.
        console: shows progress.
        data: digest of the frames, where the config does not determine them.
        timed: whether rows have times: those of another number of threads do not count.
    """

    name: str = "experiment"
    config: Mapping[str, Any] = field(default_factory=dict)
    scene_name: str = ""
    device: str = "cpu"
    cache: bool = False
    force: bool = False
    console: Console = field(default_factory=lambda: Console(highlight=False))
    data: str = ""
    timed: bool = False

    def note(self, text: str) -> None:
        """Show a line of progress."""
        self.console.print(
            f"{self.name}: {text}", style="dim", markup=False, soft_wrap=True
        )

    def scene(self, config: Mapping[str, Any], seed: int) -> Scene:
        """The scene of a resolved config at a seed."""
        return data.scene_at(config, seed, self.cache, self.console)

    def scenes(
        self, config: Mapping[str, Any], seeds: Sequence[int]
    ) -> Iterator[tuple[int, Scene]]:
        """(seed, scene) for each seed; frames of a scene are forgotten before the next."""
        for seed in seeds:
            yield seed, self.scene(config, seed)

    def part(
        self, key: Mapping[str, Any], compute: Callable[[], Iterable[Row]]
    ) -> Iterator[Row]:
        """Rows of one part of a long experiment, kept once complete: an interrupted one resumes.

        Args:
            key: tells the part from others of the same experiment and config.
            compute: makes its rows.
        """
        config = {**self.config, "part": dict(key)}
        folder = results_dir() / "cache" / "parts"
        if self.force:
            yield from compute()
        else:
            yield from self._made(folder, config, compute).rows.dicts()
        self.note(", ".join(f"{name} {value}" for name, value in key.items()))

    def measure(
        self, compute: Callable[[], Iterable[Row]], changed: Mapping[str, str]
    ) -> Measurement:
        """The record of this experiment: made, or found finished by the same code.

        Args:
            compute: makes the rows.
            changed: values that differ from those of the experiment's file, by key.

        Raises:
            locks.Held: another process measures the same.
        """
        folder = results_dir()
        with locks.held(store.lock_of(folder, self._id(self.config)), self.name):
            return self._made(folder, self.config, compute, changed, self.console)

    def _id(self, config: Mapping[str, Any]) -> str:
        determining = {k: v for k, v in config.items() if k != "_target_"}
        if self.device != "cpu":
            determining["device"] = self.device
        return name_of(self.name, determining, self.data)

    def _made(
        self,
        folder: Path,
        config: Mapping[str, Any],
        compute: Callable[[], Iterable[Row]],
        changed: Mapping[str, str] | None = None,
        console: Console | None = None,
    ) -> Measurement:
        """The record of a config in a folder; a console prints its place."""
        identity = self._id(config)
        torch = sys.modules.get("torch")
        threads = torch.get_num_threads() if torch else 1
        now = revisions(config)
        counting = threads if self.timed else None
        known = store.made_before(folder, identity, now, self.force, console, counting)
        if isinstance(known, Measurement):
            if console:
                text = _found_text(self.name, known)
                console.print(text, soft_wrap=True, markup=False)
            return known
        start = time.perf_counter()
        rows = Rows.of(compute())
        made = Measurement(
            schema=SCHEMA,
            id=identity,
            name=self.name,
            command=command(),
            task=str(config.get("_target_", "")),
            scene=self.scene_name,
            config={k: v for k, v in config.items() if k != "_target_"},
            changed=dict(changed or {}),
            data=self.data,
            revisions=now,
            environment=environment(self.device, threads),
            seconds=time.perf_counter() - start,
            rows=rows,
        )
        store.append(folder, made)
        if console:
            text = f"{self.name}: {len(rows.values)} rows in {made.seconds:.1f} s, {identity}"
            console.print(text, soft_wrap=True, markup=False)
        return made


def _found_text(name: str, known: Measurement) -> str:
    text = f"{name}: finished before (force=true runs it again)"
    versions = known.environment.other_versions
    return f"{text}, by {', '.join(versions)}" if versions else text


def experiment(
    rows: Callable[..., Iterator[Row]] | None = None,
    *,
    revision: int = 1,
    uses: Sequence[str] = (),
    timed: bool = False,
    own_memory: bool = False,
) -> Any:
    """Make a Hydra task of a generator of rows; its arguments, defaults included, are its identity.

    The task takes ``name``, ``scene_name``, ``device``, ``cache`` and ``force`` from the runner,
    binds the other arguments to those of the generator, and keeps the rows (:meth:`Run.measure`).
    Its attribute ``rows`` makes them alone. An argument that is annotated as a typed part of a
    config (:mod:`experiments.protocol.settings`), or a mapping of such, is checked and handed on as
    that.

    Args:
        rows: the generator; its first argument is the :class:`Run`.
        revision: raised when its rows change.
        uses: dotted names of what its rows depend on, and its config does not name.
        timed: whether its rows have times: such a one runs alone on its cores.
        own_memory: whether it says itself when the process keeps its memory
            (:func:`experiments.protocol.machine.keep_memory`).

    Raises:
        ValueError: from the task, for an argument that the generator does not have or lacks.
    """
    if rows is None:
        return functools.partial(
            experiment,
            revision=revision,
            uses=uses,
            timed=timed,
            own_memory=own_memory,
        )
    signature = inspect.signature(rows)

    def typed_rows(*given: Any, **named: Any) -> Iterator[Row]:
        bound = signature.bind(*given, **named)
        bound.arguments = _typed(rows, bound.arguments)
        return rows(*bound.args, **bound.kwargs)

    @functools.wraps(rows)
    def task(
        *,
        name: str | None = None,
        scene_name: str = "",
        device: str = "cpu",
        cache: bool = True,
        force: bool = False,
        **given: Any,
    ) -> Measurement:
        arguments = _bound(signature, given)
        config = {"_target_": f"{rows.__module__}.{rows.__name__}", **arguments}
        run = Run(
            name or rows.__name__,
            config,
            scene_name if "scene" in arguments else "",
            device,
            cache,
            force,
            data=_data_of(arguments),
            timed=timed,
        )
        compute = functools.partial(typed_rows, run, **arguments)
        return run.measure(compute, _changed(name, arguments))

    task.rows = typed_rows  # type: ignore[attr-defined]
    task.revision = revision  # type: ignore[attr-defined]
    task.timed = timed  # type: ignore[attr-defined]
    task.own_memory = own_memory  # type: ignore[attr-defined]
    task.components = lambda **_: uses  # type: ignore[attr-defined]
    return task


def _bound(
    signature: inspect.Signature,
    given: Mapping[str, Any],
) -> dict[str, Any]:
    """Arguments of a generator but for its first, defaults included, without displays."""
    try:
        bound = signature.bind(None, **given)
    except TypeError as error:
        keys = list(signature.parameters)[1:]
        known = f"the keys {', '.join(keys)}" if keys else "no keys"
        raise ValueError(f"task: expected {known}, found {error}") from None
    bound.apply_defaults()
    arguments = dict(list(bound.arguments.items())[1:])
    without_display: dict[str, Any] = configs.without(("display",), arguments)
    return without_display


def _typed(rows: Callable[..., Any], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a generator, those annotated as structs made so.

    Raises:
        ValueError: naming the key of a value that is wrong.
    """
    hints = typing.get_type_hints(rows)
    found = dict(arguments)
    for name, value in arguments.items():
        kind = _but_for_none(hints.get(name))
        of_values = (typing.get_args(kind) or (None,))[-1]
        if _is_struct(kind) and isinstance(value, Mapping):
            found[name] = checked(value, kind, name)
        elif _is_struct(of_values) and isinstance(value, Mapping):
            parts = value.items()
            found[name] = {k: checked(v, of_values, f"{name}.{k}") for k, v in parts}
    return found


def _but_for_none(kind: Any) -> Any:
    """The type of ``type | None``."""
    if not isinstance(kind, types.UnionType):
        return kind
    return next(one for one in typing.get_args(kind) if one is not type(None))


def _is_struct(kind: Any) -> TypeGuard[type[msgspec.Struct]]:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _changed(
    name: str | None,
    arguments: Mapping[str, Any],
) -> dict[str, str]:
    """Arguments that are not those of the experiment's file, by dotted key."""
    if name is None:
        return {}
    task = configs.task(name)
    return configs.differences(arguments, {key: task.get(key) for key in arguments})


def _data_of(arguments: Mapping[str, Any]) -> str:
    """Digest of the frames of every scene among the arguments, a user's own class too."""
    digests = []
    for key, value in arguments.items():
        if not isinstance(value, Mapping):
            continue
        target = str(value.get("_target_", ""))
        is_scene = target.startswith("scenes.") or (key == "scene" and target)
        if is_scene and not target.startswith(_DRAWN):
            scene = instantiate(value, key)
            if hasattr(scene, "fingerprint"):
                digests.append(scene.fingerprint())
    return " ".join(digests)
