"""Configs as ``configs/`` has them today: of a scene, a model or a task, and of a sweep."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from omegaconf import OmegaConf

from experiments.records.files import ROOT

CONFIGS = ROOT / "configs"
_file: Any = functools.cache(
    lambda group, name: OmegaConf.load(CONFIGS / group / f"{name}.yaml")
)
SEEDS = ("seed", "sampling_seed")  # keys of what differs from repetition to repetition


@functools.cache
def _content(group: str, name: str) -> Any:
    """What a file says after those of its ``defaults``; of these ``override /group: name`` is kept
    as the key ``chosen``."""
    whole: Any = OmegaConf.create()
    for entry in _file(group, name).get("defaults", []):
        if isinstance(entry, str):  # "file" or "file@key", of the same group
            (file, _, key), place = entry.partition("@"), group
        else:
            ((place, file),) = entry.items()
            place, _, key = place.partition("@")
        if place.startswith("override"):
            OmegaConf.update(whole, f"chosen.{place.partition('/')[2]}", file)
            continue
        if file == "_self_":
            continue
        found = _content(place.lstrip("/"), file)
        if key in ("", "_here_"):
            whole.merge_with(found)
        else:
            OmegaConf.update(whole, key, found)
    whole.merge_with(_file(group, name))
    whole.pop("defaults", None)
    return whole


@functools.cache
def _resolved(group: str, name: str, key: str) -> Any:
    """A part of the config with this file, as Hydra composes it, in a twentieth of the time: Hydra
    reads every file of every group again each time."""
    config: Any = OmegaConf.load(CONFIGS / "config.yaml")
    defaults: Any = OmegaConf.to_container(config.pop("defaults"))
    chosen = {k: v for entry in defaults if entry != "_self_" for k, v in entry.items()}
    own = _content(group, name)
    chosen |= own.get("chosen", {}) if group == "experiment" else {group: name}
    config["stop"] = _content("stop", chosen["stop"])
    for each in ("model", "scene"):
        config.merge_with(_content(each, chosen[each]))
    config.merge_with(own if group == "experiment" else {})
    return OmegaConf.to_container(config[key] or OmegaConf.create(), resolve=True)


def part(group: str, name: str) -> dict[str, Any] | None:
    """The resolved part of a config that a file of ``configs/<group>/`` makes, if it is there; a
    scene brings its ``split``, required values that are not set are ``???``."""
    if not (CONFIGS / group / f"{name}.yaml").is_file():
        return None
    keys = [group, "split"] if group == "scene" else [group]
    return {key: _resolved(group, name, key) for key in keys}


def task(experiment: str) -> dict[str, Any]:
    """The resolved task of an experiment, without displays; empty where it only sweeps."""
    if not (CONFIGS / "experiment" / f"{experiment}.yaml").is_file():
        return {}
    return without_display(_resolved("experiment", experiment, "task"))


def without_display(node: Any) -> Any:
    if isinstance(node, Mapping):
        return {key: without_display(node[key]) for key in node if key != "display"}
    return node


@functools.cache
def sweep(experiment: str) -> dict[str, list[str]]:
    """The values that an experiment sweeps over, by key: what its tables expect to find."""
    return {
        str(key): [value.strip() for value in str(values).split(",")]
        for key, values in _file("experiment", experiment).hydra.sweeper.params.items()
    }


@functools.cache
def swept_models() -> frozenset[str]:
    """Every model that an experiment sweeps over."""
    trees = (
        _file("experiment", path.stem)
        for path in (CONFIGS / "experiment").glob("*.yaml")
    )
    sweeps = (
        OmegaConf.select(tree, "hydra.sweeper.params.model", default="")
        for tree in trees
    )
    return frozenset(model.strip() for text in sweeps for model in str(text).split(","))


@functools.cache
def models(*groups: str) -> tuple[str, ...]:
    """Models of ``configs/model/`` whose ``display.group`` is one of these, HDC first."""
    names = sorted(path.stem for path in (CONFIGS / "model").glob("*.yaml"))
    names.sort(key=lambda name: (name != "hdc", name))
    return tuple(name for name in names if _display(name)["group"] in groups)


@functools.cache
def reproduction() -> tuple[dict[str, Any], ...]:
    """The steps of ``configs/reproduce.yaml``."""
    return tuple(OmegaConf.to_container(OmegaConf.load(CONFIGS / "reproduce.yaml")))  # type: ignore[arg-type]


def numbers(values: Sequence[str]) -> list[int | None]:
    """Values of a sweep as integers; null is None."""
    return [None if value == "null" else int(value) for value in values]


_own_displays: dict[str, Mapping[str, str]] = {}


def show_as(model: str, display: Mapping[str, str]) -> None:
    """Remember how a model is shown whose config is not in ``configs/model/``."""
    _own_displays[model] = display


def display(model: str) -> dict[str, str]:
    """How tables and figures show a model; one without a display by its name, in grey."""
    return _display(model) | dict(_own_displays.get(model, {}))


@functools.cache
def scene_display(scene: str) -> dict[str, Any]:
    """How tables and figures show a scene: ``name``, ``frames`` (what they are), ``kind``
    (``captured`` by a camera, ``computed`` from measured matrices, or ``simulated``), ``family``
    (the laboratory it comes from), ``place`` among the others, and ``fitted``: whether parameters
    of the scene were chosen by HDC's own accuracy on it.

    One that is not in ``configs/scene/`` is shown by its name, as a family of its own, last.
    """
    shown: dict[str, Any] = {
        "name": scene,
        "frames": "recording",
        "kind": "captured",
        "family": scene,
        "place": math.inf,
        "fitted": False,
    }
    if not (CONFIGS / "scene" / f"{scene}.yaml").is_file():
        return shown
    return shown | dict(_content("scene", scene).get("scene_display") or {})


@functools.cache
def _display(model: str) -> dict[str, str]:
    shown = {
        "name": model,
        "colour": "#666666",
        "marker": ".",
        "line": ":",
        "group": "other",
    }
    if not (CONFIGS / "model" / f"{model}.yaml").is_file():
        return shown
    return shown | dict(_content("model", model).get("display") or {})


def differences(config: Any, reference: Any, key: str = "") -> dict[str, str]:
    """Values of a config that differ from its reference, by dotted key; a missing one is null."""
    if isinstance(config, Mapping) and isinstance(reference, Mapping):
        names = dict.fromkeys([*config, *reference])
        parts = (
            differences(
                config.get(name), reference.get(name), f"{key}.{name}".lstrip(".")
            )
            for name in names
        )
        return {name: text for part in parts for name, text in part.items()}
    # A required value is no difference: a recording is known by its content.
    return (
        {} if config == reference or reference == "???" else {key: json.dumps(config)}
    )
