"""Fixed filters and ridge regression: MiniRocket in two dimensions, and wavelet scattering.

Nothing of the features is learned, so they are made once for each frame; ridge regression of
standardised features chooses its penalty by leave-one-out, as MiniRocket's authors do.
"""

from __future__ import annotations

import functools
import importlib.util
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from sklearn.linear_model import RidgeClassifierCV
from torch import Tensor
from torch.nn import functional as F

from baselines.features import FeatureClassifier
from baselines.pixels import standardise

ALPHAS = np.logspace(-3, 3, 10)
"""Penalties of the ridge regression, as in MiniRocket's own code."""


@dataclass(kw_only=True, eq=False)
class RidgeOfFeatures(FeatureClassifier):
    """Ridge regression in place of logistic regression; a subclass writes ``features``."""

    def _regression(self) -> Any:
        return RidgeClassifierCV(alphas=ALPHAS)


@dataclass(kw_only=True, eq=False)
class FixedConvolutions(RidgeOfFeatures):
    """Shares of pixels at which fixed filters exceed fixed thresholds.

    The filters are MiniRocket's (Dempster, Schmidt, Webb, KDD 2021) on a square of 3 × 3
    instead of a row of 9: weights −1 but for three of 2, all 84 of them, at each dilation. Frames
    are standardised first, and thresholds are in standard deviations of a frame, so that no frame
    decides about another.

    Args:
        dilations: distances in pixels between the nine pixels of a filter.
        thresholds: of a filter's answer.
    """

    dilations: Sequence[int] = (1, 2, 4, 8)
    thresholds: Sequence[float] = (-2.0, 0.0, 2.0)

    revision: ClassVar[int] = 1

    def features(self, batch: Tensor) -> Tensor:
        """Shares float64 [n, dilations · 84 · thresholds]."""
        images = standardise(batch)[:, None]
        filters = _filters().to(images.device)
        found = [
            share
            for image in images.split(1)  # all answers to one frame are large
            for dilation in self.dilations
            for share in self._shares(image, filters, dilation)
        ]
        return torch.tensor(found, dtype=torch.float64).view(len(images), -1)

    def _shares(self, image: Tensor, filters: Tensor, dilation: int) -> Iterator[float]:
        """Features of one frame [1, 1, H, W], threshold by threshold."""
        found = F.conv2d(image, filters, padding=dilation, dilation=dilation)
        answers = found[0].flatten(1).cpu().numpy()
        for threshold in self.thresholds:
            for answer in answers:  # counted in a tenth of the time that a mean takes
                yield np.count_nonzero(answer > threshold) / answer.size


@functools.cache
def _filters() -> Tensor:
    """float32 [84, 1, 3, 3]: three of nine weights are 2, the others −1."""
    filters = torch.full((84, 9), -1.0)
    for row, places in enumerate(itertools.combinations(range(9), 3)):
        filters[row, list(places)] = 2.0
    return filters.view(84, 1, 3, 3)


@dataclass(kw_only=True, eq=False)
class Scattering(RidgeOfFeatures):
    """Means of wavelet scattering coefficients (Bruna, Mallat, IEEE PAMI 35, 1872 (2013)).

    Args:
        scales: J; the largest wavelet is 2^J pixels wide.
        angles: of wavelets.

    Raises:
        ValueError: where kymatio is not installed.
    """

    scales: int = 3
    angles: int = 8

    revision: ClassVar[int] = 1

    def __post_init__(self) -> None:
        if importlib.util.find_spec("kymatio") is None:
            raise ValueError(
                "scattering: expected kymatio (pip install kymatio), found none"
            )

    def features(self, batch: Tensor) -> Tensor:
        """The mean of each coefficient over a standardised frame, float64 [n, coefficients]."""
        images = standardise(batch)
        shape = int(images.shape[1]), int(images.shape[2])
        if min(shape) < 2**self.scales:
            raise ValueError(
                f"scales: expected frames of {2**self.scales} pixels or more on each side, "
                f"found {shape}"
            )
        found = _scattering(self.scales, shape, self.angles)(images.cpu())
        return found.double().mean((-2, -1))


@functools.lru_cache(maxsize=2)
def _scattering(scales: int, shape: tuple[int, int], angles: int) -> Any:
    # kymatio.torch imports what a recent scipy has no more; the front has not.
    from kymatio import Scattering2D

    return Scattering2D(J=scales, shape=shape, L=angles, frontend="torch")
