"""The one face that every model shows to the runner, HDC, baselines and scikit-learn alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from torch import Tensor


@runtime_checkable
class FrameSource(Protocol):
    """Frames as a model sees them: a tensor, or something that makes a batch when indexed.

    ``frames[a:b]`` and ``frames[indices]`` give a tensor uint8 or uint16 [n, H, W];
    ``frames.shape`` is (N, H, W). A model takes what it needs batch by batch and keeps no
    reference to it.
    """

    @property
    def shape(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> Tensor: ...


@runtime_checkable
class Model(Protocol):
    """A classifier with scikit-learn's conventions that can be watched while it trains.

    The constructor takes hyperparameters only. Labels are int64 class indices; a class that is
    absent from the training labels is never predicted.
    """

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict.

        Each item becomes a row of curve.csv; its keys are its columns (``samples_seen`` always;
        ``steps`` of an optimiser, ``epoch`` and ``loss`` where they exist). The clock runs inside
        ``next()`` only, so the caller may evaluate between two items at no cost to the model. The
        caller decides when to stop; a model that has nothing left to do returns.
        """
        ...

    def predict(self, frames: FrameSource) -> np.ndarray:
        """Labels int64 [Q]."""
        ...

    def state_tensors(self) -> dict[str, Tensor] | None:
        """What has to be stored to predict, sharing memory with the model: its size is the model's
        size, and a bit flipped in it is a bit flipped in the model. None where it is not known."""
        ...
