"""The one way from a config to a scene, at a seed, with its frames kept or not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.model import instantiate
from experiments.records.configs import SEEDS
from experiments.records.files import results_dir
from scenes.frames import Scene


def at_seed(config: Any, seed: int) -> Any:
    """The resolved config of a scene with every seed in it set, as ``seed.run`` sets them."""
    if isinstance(config, Mapping):
        return {k: seed if k in SEEDS else at_seed(v, seed) for k, v in config.items()}
    return [at_seed(part, seed) for part in config] if isinstance(config, list | tuple) else config


def scene_at(config: Mapping[str, Any], seed: int, cache: bool, console: Console) -> Scene:
    """The scene of a resolved config at a seed.

    Args:
        config: ``scene`` of a resolved config.
        seed: seed of sensor and samples.
        cache: keep the frames in ``cache/`` of the results folder, where runs find them.
        console: shows the progress of making frames.

    Raises:
        ValueError: naming the key that is wrong.
    """
    scene: Scene = instantiate(OmegaConf.create(at_seed(dict(config), seed)), "scene")
    return data.cached(scene, results_dir() / "cache", console) if cache else scene
