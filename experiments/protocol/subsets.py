"""Models that can be trained on many subsets of the same frames, from their configs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omegaconf import OmegaConf

from baselines.dual import Products
from experiments.protocol.trial import instantiate

__all__ = ["Products", "models_of"]


def models_of(configs: Mapping[str, Any]) -> dict[str, Any]:
    """The models of these configurations, by name: what a file of ``configs/model`` holds.

    Raises:
        ValueError: naming the key of one that is neither HDC with binary prototypes nor computed
            from products of frames.
    """
    models = {}
    for name, part in configs.items():
        model = instantiate(OmegaConf.create(part["model"]), "model")
        if getattr(model, "prototype", "binary") != "binary" or not (
            hasattr(model, "prototype") or hasattr(model, "scores_from")
        ):
            raise ValueError(
                f"task.models.{name}: expected HDC with binary prototypes or a model computed from "
                f"products of frames (baselines.dual), found {type(model).__name__}"
            )
        models[name] = model
    return models
