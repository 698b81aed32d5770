"""Classifiers of torchhd on HDC's bits: other methods to learn prototypes.

Torchhd's own encoders project every frame on D random hypervectors, which a frame of 10⁵ pixels
does not allow; here a frame is its hypervector already. Learning, prediction and every number that
is not a field below are torchhd's own (https://github.com/hyperdimensional-computing/torchhd):

- AdaptHD (Imani et al., BioCAS 2019): sums of frames, corrected by each misclassified frame;
- OnlineHD (Hernández-Cano et al., DATE 2021): the same, weighted by the frame's dissimilarity;
- QuantHD (Imani et al., TCAD 2020): AdaptHD with signs in place of sums, after every epoch;
- LeHDC (Duan et al., DAC 2022): prototypes of signs learnt as the weights of a binary network.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier, FrameSource
from baselines.pixels import signs
from hdc.parameters import check_choice

CLASSIFIERS = ("AdaptHD", "OnlineHD", "QuantHD", "LeHDC")


@dataclass(kw_only=True, eq=False)
class TorchhdClassifier(Classifier):
    """Adapter from frames to a classifier of torchhd, its encoder replaced by the identity.

    Args:
        classifier: one of :data:`CLASSIFIERS`.
        epochs: passes over the training frames; torchhd's default is 120.
        batch_size: frames that are corrected together; torchhd's example has 12.
        seed: of the order of frames, drawn anew for each epoch, and of LeHDC's dropout.

    Raises:
        ValueError: for another name, or where torchhd is not installed.
    """

    classifier: str
    epochs: int = 120
    batch_size: int = 12
    seed: int = 0

    revision: ClassVar[int] = 1

    def __post_init__(self) -> None:
        check_choice("classifier", self.classifier, CLASSIFIERS)
        if importlib.util.find_spec("torchhd") is None:
            install = "torchhd (pip install torch-hd)"
            raise ValueError(f"{self.classifier}: expected {install}, found none")

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Fit; yields once: samples_seen = epochs · N."""
        targets = self.start(frames, labels)
        hypervectors = signs(self.read(frames, slice(0, len(frames)))).flatten(1)
        shuffled = _Shuffled(hypervectors, targets, self.batch_size, self.seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            peer = self._untrained(hypervectors.shape[1])
            with _quiet():
                peer.fit(shuffled)
        # Torchhd does not switch to evaluation: LeHDC's dropout would stay on in predictions.
        self.peer_ = peer.eval()
        yield {"samples_seen": self.epochs * len(frames)}

    def scores(self, batch: Tensor) -> Tensor:
        """Scores as in torchhd: cosines, or products with prototypes of signs; float32 [n, L]."""
        return self.peer_(signs(batch).flatten(1).float())

    def state_tensors(self) -> dict[str, Tensor]:
        """The prototypes float32 [L, D]; of QuantHD and LeHDC they are signs."""
        return {"prototypes": self.peer_.model.weight.detach()}

    def _untrained(self, dimension: int) -> Any:
        import torchhd.classifiers

        kind = getattr(torchhd.classifiers, self.classifier)
        # A class attribute goes before the encoder that the constructor makes, of one feature.
        identity = staticmethod(lambda hypervectors: hypervectors)
        on_bits = type(self.classifier, (kind,), {"encoder": identity})
        classes = len(self.classes_)
        return on_bits(1, dimension, classes, epochs=self.epochs, device=self.device)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without torchhd's progress bar, and its warning of prototypes that are still zero."""
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The norm of a vector is nearly zero")
        yield


class _Shuffled:
    """Batches of hypervectors ±1 as float32, with their classes; in another order each time."""

    def __init__(
        self, hypervectors: Tensor, targets: Tensor, batch_size: int, seed: int
    ) -> None:
        self._hypervectors, self._targets = hypervectors, targets
        self._batch_size = batch_size
        self._order = torch.Generator().manual_seed(seed)

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        order = torch.randperm(len(self._targets), generator=self._order)
        for rows in order.split(self._batch_size):
            yield self._hypervectors[rows].float(), self._targets[rows]
