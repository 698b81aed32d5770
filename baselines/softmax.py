"""Softmax regression on the pixels: p(class | x) = softmax(W·x + b)."""

from __future__ import annotations

from dataclasses import dataclass

from torch import nn

from baselines.training import IterativeClassifier


@dataclass(kw_only=True, eq=False)
class SoftmaxRegression(IterativeClassifier):
    """One linear layer from H·W pixels to L logits, by minibatches or by L-BFGS.

    The weights start at zero: the problem is convex, and every class then starts equally likely.
    Arguments and attributes are those of :class:`baselines.training.IterativeClassifier`.

    Example:
        >>> import numpy as np, torch
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]]], dtype=torch.uint8)
        >>> SoftmaxRegression(lr=0.1).fit(frames, np.array([0, 1])).predict(frames)
        array([0, 1])
    """

    def build(self, shape: tuple[int, int], classes: int) -> nn.Module:
        linear = nn.Linear(shape[0] * shape[1], classes)
        nn.init.zeros_(linear.weight)
        nn.init.zeros_(linear.bias)
        return nn.Sequential(nn.Flatten(), linear)
