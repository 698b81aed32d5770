"""The interface of every model to the runner, and the way from a config to a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import hydra
import numpy as np
from omegaconf import OmegaConf
from torch import Tensor

from baselines import library
from hdc.inputs import FrameSource


@runtime_checkable
class Model(Protocol):
    """A classifier with scikit-learn's conventions that can be watched while it trains.

    :mod:`baselines.library` has `train` and `state_tensors` for the classifiers of the library.

    The constructor takes hyperparameters only. Frames are a tensor uint8 or uint16 [N, H, W], or an
    object that gives such a batch when indexed (``frames[a:b]``, ``frames[indices]``) and has
    ``shape``; a model takes what it needs batch by batch and keeps no reference. Labels are int64
    class indices; a class that is absent from the training labels is never predicted.
    """

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict.

        Each item becomes a row of the record's curve; its keys are the columns (``samples_seen``
        always; ``steps`` of an optimiser, ``epoch`` and ``loss`` where they exist), its values
        numbers. The clock runs inside ``next()`` only, so the caller may evaluate between two items
        at no cost to the model. Stopping is up to the caller; a model that has converged returns.
        """
        ...

    def predict(self, frames: FrameSource) -> np.ndarray:
        """Labels int64 [Q]."""
        ...

    def state_tensors(self) -> dict[str, Tensor] | None:
        """The tensors that a prediction needs, sharing memory with the model: their size is the
        model's size, and a bit flipped in them is a bit flipped in the model. None where that is
        not known."""
        ...


def check_model(model: Any, key: str = "model") -> None:
    """Raise ValueError, saying what to write instead, unless the object can train and predict."""
    if not library.can_train(model):
        raise ValueError(
            f"{key}: expected an object with train and predict, found {type(model).__name__}; "
            "model._target_ names a class, below a first line '# @package _global_'; an estimator "
            "of scikit-learn goes into baselines.sklearn_classifier"
        )


def instantiate(config: Mapping[str, Any], key: str) -> Any:
    """Build the object of a resolved part of a config; its own error gets the key in front."""
    whole = OmegaConf.create({key: dict(config)})  # Hydra's errors have the whole key
    try:
        return hydra.utils.instantiate(whole[key], _convert_="all")
    except hydra.errors.InstantiationException as error:
        cause = error.__cause__
        if not isinstance(cause, ValueError | TypeError | OSError):
            raise
        text = str(cause)
        raise ValueError(
            text if text.startswith(f"{key}.") else f"{key}: {text}"
        ) from error


def models_of(configs: Mapping[str, Any]) -> dict[str, Any]:
    """Models by name, of what a file of ``configs/model`` holds.

    Raises:
        ValueError: naming the key of one that cannot train and predict.
    """
    models = {}
    for name, part in configs.items():
        key = f"task.models.{name}.model"
        models[name] = instantiate(part["model"], key)
        check_model(models[name], key)
    return models
