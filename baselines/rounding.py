"""Weights of eight bits: a fair size beside packed bits.

A model is trained in floating point and rounded afterwards, as most libraries quantise for small
devices: x = q·s with q in −127…127 and a step s = max|x| / 127 for each tensor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines.base import FrameSource
from baselines.softmax_dual import DualSoftmaxRegression
from hdc.bank import Bank


def to_int8(tensor: Tensor) -> tuple[Tensor, Tensor]:
    """Numbers as int8 of the same shape, and the step between two of them, []."""
    step = tensor.abs().max() / 127
    q = torch.round(tensor / step.clamp(min=1e-30)).to(torch.int8)
    return q, step


@dataclass(kw_only=True, eq=False)
class RoundedSoftmaxRegression(DualSoftmaxRegression):
    """Converged softmax regression, with weights of eight bits.

    Arguments are those of :class:`baselines.softmax_dual.DualSoftmaxRegression`.

    Attributes:
        weight_: int8 [L, D], in steps of ``step_``, float32 [].
        bias_: float32 [L]; keeps the score of the mean training frame.
    """

    revision: ClassVar[int] = 1

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Solve and round; yields once: samples_seen = N, epoch = 1 and the loss."""
        for report in super().train(frames, labels):
            exact = self.weight_
            self.weight_, self.step_ = to_int8(exact)
            lost = exact - self._weights()
            moved = lost.double() @ self._mean.double()
            self.bias_ = (self.bias_ + moved).float()
            yield report

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b, float32 [n, L]."""
        scaled = self._scaling(batch).flatten(1)
        return torch.addmm(self.bias_, scaled, self._weights().T)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """Rounded weights do not follow from products of frames, so it is trained on these."""
        model = replace(self).fit(bank.at(train), bank.labels[train])
        return model.predict(bank.at(queries))

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, D], step [] and bias [L]."""
        return {
            "weight": self.weight_,
            "step": self.step_,
            "bias": self.bias_,
        }

    def _weights(self) -> Tensor:
        return self.weight_ * self.step_
