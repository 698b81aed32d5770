"""The simplest baseline: logistic regression of a few numbers of a frame.

Where it is as accurate as a classifier of all pixels, classes differ in brightness or in coarse
layout, and recognising them needs no speckle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import cv2
import numpy as np
import torch
from sklearn.linear_model import LogisticRegression
from sklearn.preprocessing import StandardScaler
from torch import Tensor

from baselines.bank import Bank
from baselines.base import Classifier, FrameSource

_BATCH = 64  # frames that features are made of at a time


@dataclass(kw_only=True, eq=False)
class Thumbnail(Classifier):
    """Logistic regression of a picture of a few pixels, each the mean of the pixels of the frame
    that it covers, standardised over the training frames.

    Args:
        width, height: of the picture, in pixels.
        C: inverse strength of the penalty, as in scikit-learn's LogisticRegression.

    Attributes:
        mean_, deviation_: of each pixel of the pictures, float64 [F], F = width · height.
        weight_, bias_: float64 [L, F] and [L].
    """

    width: int = 8
    height: int = 6
    C: float = 1.0

    revision: ClassVar[int] = 1

    def features(self, batch: Tensor) -> Tensor:
        """Pixels of the pictures, each of its frame alone: [n, H, W] → float64 [n, F] (CPU)."""
        size = self.width, self.height
        pictures = []
        for frame in batch.reshape(-1, *self.shape_).float().numpy(force=True):
            picture = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
            pictures.append(torch.from_numpy(picture))
        return torch.stack(pictures).flatten(1).double()

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Fit; yields once: samples_seen = N."""
        targets = self.start(frames, labels)
        features = []
        for start in range(0, len(frames), _BATCH):
            batch = self.read(frames, slice(start, start + _BATCH))
            features.append(self.features(batch))
        self._fit(torch.cat(features), targets)
        yield {"samples_seen": len(frames)}

    def scores(self, batch: Tensor) -> Tensor:
        """Logits, float64 [n, L]."""
        return self._logits(self.features(batch))

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        model = replace(self)
        targets = model.start(bank.at(train), bank.labels[train])
        kind = type(self), self.width, self.height
        features = bank.each(model.features, kind)
        model._fit(features[train], targets)
        best = model._logits(features[queries]).argmax(dim=1)
        return model.classes_[best.numpy()]

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, F] and bias [L], and mean and deviation of the features."""
        return {
            "weight": self.weight_,
            "bias": self.bias_,
            "mean": self.mean_,
            "deviation": self.deviation_,
        }

    def _fit(self, features: Tensor, targets: Tensor) -> None:
        scaler = StandardScaler().fit(features.numpy())
        regression = LogisticRegression(C=self.C, max_iter=1000)
        standardised = scaler.transform(features.numpy())
        regression.fit(standardised, targets.numpy(force=True))
        self.mean_ = torch.from_numpy(scaler.mean_)
        self.deviation_ = torch.from_numpy(scaler.scale_)
        weight = torch.from_numpy(regression.coef_).contiguous()
        bias = torch.from_numpy(regression.intercept_)
        if len(weight) == 1:  # of two classes scikit-learn has the logit of the second
            weight = torch.cat([-weight, weight])
            bias = torch.cat([-bias, bias])
        self.weight_, self.bias_ = weight, bias

    def _logits(self, features: Tensor) -> Tensor:
        standardised = (features - self.mean_) / self.deviation_
        # Row by row: a logit does not depend on how many are asked for.
        products = standardised[:, None] * self.weight_
        return products.sum(dim=2) + self.bias_
