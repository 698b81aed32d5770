"""What Hydra composes of ``configs/``: for tests that need a config and no command."""

from __future__ import annotations

import functools
from typing import Any

from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from experiments.protocol.settings import checked
from experiments.protocol.task import Task
from experiments.records import configs


@functools.cache
def tree(*words: str, with_hydra: bool = False) -> Any:
    """The config of a command line; nobody may change it."""
    with initialize_config_dir(str(configs.CONFIGS), version_base="1.3"):
        return compose("config", list(words), return_hydra_config=with_hydra)


def composed(*words: str) -> dict[str, Any]:
    """The resolved config of a command line."""
    found: Any = OmegaConf.to_container(tree(*words), resolve=True)
    return found


def part(group: str, name: str) -> dict[str, Any]:
    """What a file of a group makes; a scene brings its ``split``."""
    config = composed(f"{group}={name}")
    keys = (group, "split") if group == "scene" else (group,)
    return {key: config[key] for key in keys}


def models(*names: str) -> dict[str, Any]:
    """What files of models make, by name, as tasks take them."""
    return {name: part("model", name) for name in names}


def task(experiment: str) -> dict[str, Any]:
    """The task of an experiment, without displays; empty where it only sweeps."""
    found = composed(f"experiment={experiment}")["task"] or {}
    bare: dict[str, Any] = configs.without(("display",), found)
    return bare


def made(kind: type[Task], **config: Any) -> Task:
    """A task of this config, checked as the runner does."""
    config.pop("_target_", None)
    return checked(config, kind, "task")
