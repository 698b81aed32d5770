"""Cost of a model: training time, time per frame, bytes; and the models on the front."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import HDCClassifier
from hdc.command.compare.frames import FrameBank
from hdc.command.compare.rivals import Rival
from hdc.selection import Combination, Frames

BATCH = 100
"""Frames that are asked about at a time."""
_ROWS = 200  # of a matrix that are multiplied with; more take proportionally longer


@dataclass(frozen=True)
class Cost:
    """Seconds of training, milliseconds a frame of prediction, bytes to keep."""

    train_s: float
    frame_ms: float
    n_bytes: int

    def as_json(self) -> dict[str, float]:
        return {
            "train_s": self.train_s,
            "predict_ms": self.frame_ms,
            "bytes": self.n_bytes,
        }


@dataclass
class Costs:
    """Costs of models that learn some frames and are asked about others.

    Attributes:
        frames: all of them.
        train, test: indices.
        products_s: seconds that the inner products of the training frames took, by kind of greys.
    """

    frames: Frames
    train: np.ndarray
    test: np.ndarray
    products_s: dict[str, float] = field(default_factory=dict)
    _own: Frames | None = None

    def of(self, method: Any) -> Cost:
        """Measured once, from the frames as they are in memory."""
        if isinstance(method, Combination):
            return self._of_form(method)
        return self._of_rival(method)

    def _of_form(self, method: Combination) -> Cost:
        images = self.frames.bank.frames[self.train]
        model: Any
        if self.frames.values is None:
            model = HDCClassifier(method.encoder, method.readout)
            targets = self.frames.labels[self.train]
        else:
            model = self.frames.regressor(method.encoder, method.readout)
            targets = self.frames.values[self.train]
        start = time.perf_counter()
        model.fit(images, targets)
        train_s = time.perf_counter() - start
        frame_ms = self._per_frame(model.predict)
        return Cost(train_s, frame_ms, model.prediction_bytes_)

    def _of_rival(self, rival: Rival) -> Cost:
        """As it is computed here: from inner products of the training frames.

        A prediction is products of a frame with so many rows: the weights of a linear model, or all
        training frames. What the rows hold does not change the time.
        """
        own = self._training_frames()
        if rival.pixels not in self.products_s:
            start = time.perf_counter()
            own.bank.products(rival.pixels)  # type: ignore[attr-defined]
            self.products_s[rival.pixels] = time.perf_counter() - start
        own.bank.coordinates.clear()  # type: ignore[attr-defined]
        every = np.arange(len(self.train))
        start = time.perf_counter()
        rival.answers(own, every, every[:1])
        train_s = self.products_s[rival.pixels] + time.perf_counter() - start
        flat = own.bank.frames.flatten(1)
        if rival.keeps_frames:
            n_rows, n_bytes = len(flat), flat.nbytes
        else:
            n_rows = rival.n_functions(own)
            n_bytes = 4 * n_rows * flat.shape[1]
        matrix = torch.ones(min(n_rows, _ROWS), flat.shape[1])

        def predict(batch: Tensor) -> None:
            pixels = batch.flatten(1).float()
            if rival.pixels == "standardised":
                pixels = pixels - pixels.mean(1, keepdim=True)
                pixels /= pixels.std(1, keepdim=True)
            pixels @ matrix.T

        frame_ms = self._per_frame(predict) * max(1, n_rows / _ROWS)
        return Cost(train_s, frame_ms, n_bytes)

    def _training_frames(self) -> Frames:
        if self._own is None:
            images = self.frames.bank.frames[self.train].numpy()
            labels = self.frames.labels[self.train]
            bank = FrameBank(images, labels, self.frames.bank.n_classes)
            values = self.frames.values
            values = None if values is None else values[self.train]
            self._own = replace(self.frames, bank=bank, values=values)
        return self._own

    def _per_frame(self, predict: Callable[[Tensor], Any]) -> float:
        """Milliseconds a frame, in batches."""
        images = self.frames.bank.frames[self.test]
        predict(images[:1])
        start = time.perf_counter()
        for batch in images.split(BATCH):
            predict(batch)
        return 1000 * (time.perf_counter() - start) / len(images)


def front(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """The names of the points (error, time) that no other point beats.

    Another one beats it that has no more of both and less of one.
    """
    found = []
    for name, (error, seconds) in points.items():
        beaten = any(
            e <= error and s <= seconds and (e, s) != (error, seconds)
            for e, s in points.values()
        )
        if not beaten:
            found.append(name)
    return found
