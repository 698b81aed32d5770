"""What ``configs/`` says today: the config of a scene and a model, of a task, and what is swept."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from experiments.records.files import ROOT

CONFIGS = ROOT / "configs"
SEEDS = ("seed", "sampling_seed")  # keys of what differs from repetition to repetition


@functools.cache
def _composed(*overrides: str) -> dict[str, Any]:
    state = GlobalHydra.instance()
    running, state.hydra = state.hydra, None  # a task of experiments.run may ask, too
    try:
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            cfg = compose("config", overrides=list(overrides))
    finally:
        GlobalHydra.instance().hydra = running
    return OmegaConf.to_container(cfg, resolve=True, throw_on_missing=False)  # type: ignore[return-value]


def of_scene(name: str) -> dict[str, Any] | None:
    """The resolved parts ``scene`` and ``split`` for a file of ``configs/scene/``, if it is there.

    What the user has to set is ``???``.
    """
    if not (CONFIGS / "scene" / f"{name}.yaml").is_file():
        return None
    whole = _composed(f"scene={name}")
    return {key: whole[key] for key in ("scene", "split")}


def of_model(name: str) -> dict[str, Any] | None:
    """The resolved part ``model`` of a config of ``configs/model/``, if there is one."""
    if not (CONFIGS / "model" / f"{name}.yaml").is_file():
        return None
    return {"model": _composed(f"model={name}")["model"]}


def of_stop(name: str) -> dict[str, Any] | None:
    """The resolved part ``stop`` of a config of ``configs/stop/``, if there is one."""
    if not (CONFIGS / "stop" / f"{name}.yaml").is_file():
        return None
    return {"stop": _composed(f"stop={name}")["stop"]}


def task(experiment: str) -> dict[str, Any]:
    """The resolved task of an experiment; empty for an experiment that only sweeps.

    How its models are shown is no part of it.
    """
    if not (CONFIGS / "experiment" / f"{experiment}.yaml").is_file():
        return {}
    return without_display(_composed(f"experiment={experiment}")["task"] or {})


def without_display(node: Any) -> Any:
    if isinstance(node, Mapping):
        return {key: without_display(node[key]) for key in node if key != "display"}
    return node


def sweep(experiment: str) -> dict[str, list[str]]:
    """The values that an experiment sweeps over, by key: what its tables expect to find."""
    tree = OmegaConf.load(CONFIGS / "experiment" / f"{experiment}.yaml")
    return {
        str(key): [value.strip() for value in str(values).split(",")]
        for key, values in tree.hydra.sweeper.params.items()
    }


@functools.cache
def swept_models() -> frozenset[str]:
    """Every model that an experiment sweeps over."""
    names = [path.stem for path in (CONFIGS / "experiment").glob("*.yaml")]
    trees = (OmegaConf.load(CONFIGS / "experiment" / f"{name}.yaml") for name in names)
    sweeps = (OmegaConf.select(tree, "hydra.sweeper.params.model", default="") for tree in trees)
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


def minutes() -> dict[str, float]:
    """About what each experiment takes on 2 cores: all of its steps in the full reproduction."""
    found: dict[str, float] = {}
    for step in reproduction():
        if name := re.search(r"\bexperiment=(\w+)", step.get("full", "")):
            found[name[1]] = found.get(name[1], 0) + step["minutes"]["full"]
    return found


def numbers(values: Sequence[str]) -> list[int | None]:
    """Values of a sweep as integers; null is None."""
    return [None if value == "null" else int(value) for value in values]


_own_displays: dict[str, Mapping[str, str]] = {}


def show_as(model: str, display: Mapping[str, str]) -> None:
    """Remember how a model is shown whose config is not in ``configs/model/``."""
    _own_displays[model] = display


def display(model: str) -> Mapping[str, str]:
    """How tables and figures show a model: ``name``, ``colour``, ``marker``, ``line``, ``group``.

    A model that says nothing of it has the name it was called by, in grey.
    """
    return _display(model) | dict(_own_displays.get(model, {}))


@functools.cache
def _display(model: str) -> dict[str, str]:
    shown = {"name": model, "colour": "#666666", "marker": ".", "line": ":", "group": "other"}
    path = CONFIGS / "model" / f"{model}.yaml"
    if not path.is_file():
        return shown
    tree: Any = OmegaConf.load(path)
    return shown | dict(tree.get("display") or {})


def differences(config: Any, reference: Any, key: str = "") -> dict[str, str]:
    """What a config has that its reference has not, by dotted key; a part that is gone is null."""
    if isinstance(config, Mapping) and isinstance(reference, Mapping):
        return {
            name: text
            for part in dict.fromkeys([*config, *reference])
            for name, text in differences(
                config.get(part), reference.get(part), f"{key}.{part}".lstrip(".")
            ).items()
        }
    # What the user has to set is no difference: a recording is known by its content.
    return {} if config == reference or reference == "???" else {key: json.dumps(config)}
