"""The simplest baselines: logistic regression of a few numbers of a frame.

Where one of these is as accurate as a classifier of all pixels, classes differ in brightness or in
coarse layout, and recognising them needs no speckle.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from typing import ClassVar

import cv2
import numpy as np
import torch
from sklearn.linear_model import LogisticRegression
from sklearn.preprocessing import StandardScaler
from torch import Tensor

from baselines.bank import Bank
from baselines.base import Classifier, FrameSource, arithmetic

_BATCH = 64  # frames that features are made of at a time


@dataclass(kw_only=True, eq=False)
class FeatureClassifier(Classifier):
    """Logistic regression of standardised features; a subclass writes ``features``.

    Args:
        C: inverse strength of the penalty, as in scikit-learn's LogisticRegression.

    Attributes:
        mean_, deviation_: of each feature over the training frames, float64 [F].
        weight_, bias_: float64 [L, F] and [L].
    """

    C: float = 1.0

    @abstractmethod
    def features(self, batch: Tensor) -> Tensor:
        """Features of each frame, independent of others: [n, H, W] → float64 [n, F] (CPU)."""

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
        features = model._features_of(bank)
        model._fit(features[train], targets)
        best = model._logits(features[queries]).argmax(dim=1)
        return model.classes_[best.numpy()]

    def _features_of(self, bank: Bank) -> Tensor:
        """Features of all frames, computed once for all models of these parameters."""

        def features(batch: Tensor) -> Tensor:
            images = arithmetic(batch).reshape(-1, *self.shape_)
            return self.features(images)

        parameters = repr(astuple(self))
        return bank.each(features, key=(type(self), parameters))

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


@dataclass(kw_only=True, eq=False)
class Brightness(FeatureClassifier):
    """Two numbers per frame: the mean and the standard deviation of its pixels."""

    revision: ClassVar[int] = 1

    def features(self, batch: Tensor) -> Tensor:
        pixels = batch.flatten(1).cpu().double()
        mean = pixels.mean(dim=1)
        deviation = pixels.std(dim=1, correction=0)
        return torch.stack([mean, deviation], dim=1)


@dataclass(kw_only=True, eq=False)
class Thumbnail(FeatureClassifier):
    """A picture of a few pixels, each the mean of the pixels of the frame that it covers.

    Args:
        width, height: of the picture, in pixels.
    """

    width: int = 8
    height: int = 6

    revision: ClassVar[int] = 1

    def features(self, batch: Tensor) -> Tensor:
        size = self.width, self.height
        pictures = []
        for frame in batch.float().numpy(force=True):
            picture = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
            pictures.append(torch.from_numpy(picture))
        return torch.stack(pictures).flatten(1).double()
