"""Softmax regression on the pixels: p(class | x) = softmax(W·x + b)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from torch import nn

from baselines.training import IterativeClassifier


@dataclass(kw_only=True, eq=False)
class SoftmaxRegression(IterativeClassifier):
    """One linear layer from H·W pixels to L logits, by minibatches or by L-BFGS.

    For arguments and attributes see :class:`baselines.training.IterativeClassifier`. Where a
    training ends before the optimum, its accuracy depends on the initial weights: plain gradient
    descent never changes what lies outside the span of the frames.

    Example:
        >>> import numpy as np, torch
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]]], dtype=torch.uint8)
        >>> SoftmaxRegression(lr=0.1).fit(frames, np.array([0, 1])).predict(frames)
        array([0, 1])
    """

    revision: ClassVar[int] = 1

    def build(
        self,
        shape: tuple[int, int],
        classes: int,
    ) -> nn.Module:
        height, width = shape
        return nn.Sequential(nn.Flatten(), nn.Linear(height * width, classes))
