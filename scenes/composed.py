"""The scene of words of the command line, as :mod:`experiments.run` composes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch


def config_of(overrides: Sequence[str]) -> Any:
    """The config that is configs/config.yaml with these overrides."""
    from hydra import compose, initialize_config_module

    with initialize_config_module("configs", version_base="1.3"):
        return compose("config", overrides=list(overrides))


def scene_of(overrides: Sequence[str]) -> Any:
    """The scene of configs/config.yaml with these overrides."""
    from hydra.utils import instantiate

    config = config_of(overrides)
    torch.set_num_threads(config.threads or torch.get_num_threads())
    return instantiate(config.scene, _convert_="all")
