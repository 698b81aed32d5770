"""Contents of ``configs/`` as they stand in the files: displays, sweeps and steps."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from experiments.records.files import ROOT

CONFIGS = ROOT / "configs"
SEEDS = ("seed", "random_state", "sampling_seed")
"""Keys of what differs from repetition to repetition."""
# What a row asks for by number; and where a recording lies, which is known by its content.
COORDINATES = ("split.n_train", "data.pixels", "scene.path")
_DISPLAYS = {"model": "display", "scene": "scene_display"}
_FRAMES = {
    "frames": "recording",
    "kind": "captured",
    "order": math.inf,
    "fitted": False,
    "figure": "",
}
_LOOK = {
    "colour": "#666666",
    "marker": ".",
    "line": ":",
    "group": "other",
}


def is_known(group: str, name: str) -> bool:
    """Whether there is a file of this name in a group."""
    return (CONFIGS / group / f"{name}.yaml").is_file()


@functools.cache
def sweep(experiment: str) -> dict[str, list[str]]:
    """The values that an experiment sweeps over, by key: what its tables expect to find."""
    params = _file("experiment", experiment)
    for key in ("hydra", "sweeper", "params"):
        params = params.get(key, {})
    return {key: re.split(r"\s*,\s*", str(text)) for key, text in params.items()}


@functools.cache
def scene_of(experiment: str) -> str:
    """The scene that an experiment of ``configs/`` has unless another one is asked for; of others
    nothing."""
    if not is_known("experiment", experiment):
        return ""
    found = "touch"  # as configs/config.yaml
    for entry in _file("experiment", experiment).get("defaults", ()):
        if isinstance(entry, Mapping):
            found = entry.get("override /scene", found)
        elif entry != "_self_":
            found = scene_of(entry)
    return found


@functools.cache
def swept_models() -> frozenset[str]:
    """Every model that an experiment sweeps over."""
    names = (path.stem for path in (CONFIGS / "experiment").glob("*.yaml"))
    return frozenset(model for name in names for model in sweep(name).get("model", ()))


@functools.cache
def models(*groups: str) -> tuple[str, ...]:
    """Models of ``configs/model/`` whose ``display.group`` is one of these, HDC first."""
    names = (path.stem for path in (CONFIGS / "model").glob("*.yaml"))
    shown = (name for name in names if display(name)["group"] in groups)
    return tuple(sorted(shown, key=lambda name: (name != "hdc", name)))


@functools.cache
def reproduction() -> tuple[dict[str, Any], ...]:
    """The steps of ``configs/reproduce.yaml``."""
    return tuple(_read(CONFIGS / "reproduce.yaml"))


def numbers(values: Sequence[str]) -> list[int]:
    """Values of a sweep as integers; null, which stands for all, is 0."""
    return [0 if value == "null" else int(value) for value in values]


_own_displays: ContextVar[Mapping[tuple[str, str], Mapping[str, Any]]] = ContextVar(
    "own displays", default=MappingProxyType({})
)


@contextmanager
def shown_as(
    displays: Mapping[tuple[str, str], Mapping[str, Any]],
) -> Iterator[None]:
    """Show models and scenes, by group and name, that have no file in ``configs/``, as these."""
    token = _own_displays.set(displays)
    try:
        yield
    finally:
        _own_displays.reset(token)


def display(model: str) -> dict[str, str]:
    """How tables and figures show a model; one without a display by its name, in grey."""
    return _shown("model", model) | dict(_own_displays.get().get(("model", model), {}))


def scene_display(scene: str) -> dict[str, Any]:
    """How tables and figures show a scene: ``name``, ``frames`` (what they are), ``kind``
    (``captured`` by a camera, ``computed`` from measured matrices, or ``simulated``), ``family``
    (the laboratory it comes from), ``order`` among the others, ``fitted``: whether parameters of
    the scene were chosen by HDC's own accuracy on it, and ``figure``: of the paper, which shows the
    confusion of its classes.

    A scene of which something was changed (``touch (n=3)``) is of the kind and the family of its
    config. One that is not in ``configs/scene/`` is shown by its name, last, as a family of its
    own.
    """
    name = scene.partition(" ")[0]
    own = _own_displays.get().get(("scene", name), {})
    return _shown("scene", name) | dict(own)


@functools.cache
def _shown(group: str, name: str) -> dict[str, Any]:
    """How a model or a scene is shown by its file; by its name where there is none."""
    shown = {"name": name, **(_LOOK if group == "model" else _FRAMES)}
    if group == "scene":
        shown["family"] = name
    if is_known(group, name):
        shown |= _inherited(group, name, _DISPLAYS[group])
    return shown


@functools.cache
def _inherited(
    group: str,
    name: str,
    key: str,
) -> dict[str, Any]:
    """A key of a file, above that of the files of its group that it starts from."""
    file = _file(group, name)
    found: dict[str, Any] = {}
    for entry in file.get("defaults", []):
        if isinstance(entry, str) and entry != "_self_":
            found |= _inherited(group, entry.partition("@")[0], key)
    return found | dict(file.get(key) or {})


@functools.cache
def _file(group: str, name: str) -> dict[str, Any]:
    found: dict[str, Any] = _read(CONFIGS / group / f"{name}.yaml")
    return found


def _read(path: Path) -> Any:
    """The content of a file, references to other keys as they stand: Hydra is not needed."""
    return yaml.safe_load(path.read_text("utf-8"))


def without(keys: Iterable[str], node: Any) -> Any:
    """A config without these keys, at any depth."""
    keys = tuple(keys)
    if isinstance(node, Mapping):
        return {k: without(keys, value) for k, value in node.items() if k not in keys}
    if isinstance(node, list | tuple):
        return [without(keys, value) for value in node]
    return node


def flat(node: Any, key: str = "") -> dict[str, Any]:
    """The values of a config that are no mappings, by their dotted keys.

    Args:
        node: of a resolved config.
        key: of the node itself.
    """
    if not isinstance(node, Mapping):
        return {key: node}
    found: dict[str, Any] = {}
    for name, value in node.items():
        found |= flat(value, f"{key}.{name}".lstrip("."))
    return found


def mappings(node: Any) -> Iterator[Mapping[str, Any]]:
    """Every mapping in a config, at any depth, each before the ones within it, which follow in
    the order of their keys."""
    if isinstance(node, Mapping):
        yield node
        node = [node[key] for key in sorted(node, key=str)]
    if isinstance(node, list | tuple):
        for value in node:
            yield from mappings(value)
