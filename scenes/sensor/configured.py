"""Scenes by name for this package's commands: configs/scene/NAME.yaml with its seeds filled in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import OmegaConf

from scenes.sensor.scene import SpeckleScene

FOLDER = Path(__file__).parents[2] / "configs" / "scene"


def scene(
    name: str, sensor: int = 0, samples: int = 0, overrides: Sequence[str] = (), device: str = "cpu"
) -> SpeckleScene:
    """The scene ``name`` for these seeds; overrides like ``contact.depth=1e-3``."""
    root = OmegaConf.create({"seed": {"sensor": sensor, "samples": samples}, "device": device})
    root.scene = OmegaConf.load(FOLDER / f"{name}.yaml")
    for override in overrides:
        key, value = override.split("=", 1)
        OmegaConf.update(root.scene, key, OmegaConf.create(f"value: {value}").value)
    return instantiate(root.scene, _convert_="all")
