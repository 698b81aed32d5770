"""The interface of every model to the runner: HDC, baselines and scikit-learn alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from torch import Tensor

from baselines.base import FrameSource


@runtime_checkable
class Model(Protocol):
    """A classifier with scikit-learn's conventions that can be watched while it trains.

    The constructor takes hyperparameters only. Frames are a tensor uint8 or uint16 [N, H, W], or an
    object that gives such a batch when indexed (``frames[a:b]``, ``frames[indices]``) and has
    ``shape``; a model takes what it needs batch by batch and keeps no reference. Labels are int64
    class indices; a class that is absent from the training labels is never predicted.
    """

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict.

        Each item becomes a row of curve.csv; its keys are its columns (``samples_seen`` always;
        ``steps`` of an optimiser, ``epoch`` and ``loss`` where they exist), its values numbers. The
        clock runs inside ``next()`` only, so the caller may evaluate between two items at no cost
        to the model. Stopping is up to the caller; a model that has converged returns.
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


def check_model(model: Any) -> None:
    """Raise ValueError, saying what to write instead, unless the object can train and predict."""
    missing = [name for name in ("train", "predict") if not callable(getattr(model, name, None))]
    if not missing:
        return
    kind = type(model).__name__
    hint = ""
    if hasattr(model, "fit"):
        hint = "; an estimator of scikit-learn goes into baselines.sklearn_classifier"
    elif isinstance(model, Mapping):
        hint = "; model._target_ names the class, below a first line '# @package _global_'"
    raise ValueError(
        f"model: expected an object with train and predict, found {kind} without "
        f"{' and '.join(missing)}{hint}"
    )
