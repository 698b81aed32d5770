"""Convolutional network: blocks of convolution, ReLU and max pooling, then one linear layer.

The paper compares with "a CNN" of one and of three convolution layers with max pooling and gives
no more. Our choices are the textbook's: filters doubling from layer to layer, LeNet's 5×5 kernels
and 2×2 pooling (LeCun et al., Proc. IEEE 86, 2278 (1998)), padding that keeps the size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from torch import nn

from baselines.training import IterativeClassifier

KERNEL = 5  # pixels a side
POOL = 2  # pixels a side, also the stride


@dataclass(kw_only=True, eq=False)
class CNN(IterativeClassifier):
    """A convolution layer of ``filters[k]`` filters for each k, then the classes.

    Args:
        filters: number of filters, layer by layer: [16] or [16, 32, 64].

    For others see :class:`baselines.training.IterativeClassifier`.

    Weights that start at zero are refused: no gradient would reach any layer but the last.
    """

    filters: Sequence[int] = (16,)

    revision: ClassVar[int] = 1
    # As in training: the maps of a frame take 20 MB.
    prediction_batch: ClassVar[int] = 20

    def build(
        self,
        shape: tuple[int, int],
        classes: int,
    ) -> nn.Module:
        if self.init == "zeros":
            raise ValueError("init: expected linear or normal for a CNN, found 'zeros'")
        layers: list[nn.Module] = []
        (height, width), channels = shape, 1
        for filters in self.filters:
            layers += [
                nn.Conv2d(channels, filters, KERNEL, padding=KERNEL // 2),
                # Pooling first gives the same maps as ReLU first, at a quarter of the ReLU's work.
                nn.MaxPool2d(POOL),
                nn.ReLU(inplace=True),
            ]
            (height, width), channels = (height // POOL, width // POOL), filters
        return nn.Sequential(
            *layers, nn.Flatten(), nn.Linear(channels * height * width, classes)
        )
