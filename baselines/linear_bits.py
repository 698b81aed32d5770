"""A linear read-out of HDC's own bits, to compare majority voting with.

On the hypervectors of frames, ±1, HDC's prototype of a class is the sign of a sum of its training
frames, a linear read-out of one bit per weight. Here ridge regression learns the weights instead
(see baselines.ridge). They stay float32, or are reduced to their signs, as many bytes as HDC's
prototypes, with a scale and a bias per class,

    s_c(x) = ‖w_c‖₁/D · sign(w_c)·(x − x̄) + b_c,

which is the nearest such vector to w_c (Rastegari et al., XNOR-Net, ECCV 2016, Eq. 6).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines.bank import Bank
from baselines.base import FrameSource
from baselines.ridge import RidgeReadout
from hdc import bits


@dataclass(kw_only=True, eq=False)
class BitReadout(RidgeReadout):
    """Ridge classifier of the thresholded pixels, ±1.

    Args:
        alpha: strength of the penalty, above zero.
        one_bit: keep the signs of the weights only.

    Attributes:
        weight_: float32 [L, D]; with ``one_bit`` int64 [L, ⌈D/64⌉], one bit per sign.
        sign_scale_: float32 [L], with ``one_bit``.
        bias_: float32 [L].
    """

    pixels: str = "bits"
    one_bit: bool = False

    revision: ClassVar[int] = 1

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N, epoch = 1 and the mean squared error."""
        for report in super().train(frames, labels):
            if self.one_bit:
                weight = self.weight_
                self.sign_scale_ = weight.abs().mean(dim=1)
                self.weight_ = bits.pack(weight >= 0)
                change = weight - self.sign_scale_[:, None] * self._signs(
                    weight.shape[1]
                )
                moved = change.double() @ self._mean.double()
                self.bias_ = (self.bias_ + moved).float()
            yield report

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """Like ridge regression; signs of weights do not follow from products of frames."""
        if not self.one_bit:
            return super().predict_from(bank, train, queries)
        model = replace(self).fit(bank.at(train), bank.labels[train])
        return model.predict(bank.at(queries))

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b of the bits x, float32 [n, L]."""
        if not self.one_bit:
            return super().scores(batch)
        x = self._scaling(batch).flatten(1)
        products = x @ self._signs(x.shape[1]).T
        return torch.addcmul(self.bias_, self.sign_scale_, products)

    def state_tensors(self) -> dict[str, Tensor]:
        """weight and bias, and the scale of signs."""
        state = super().state_tensors()
        if self.one_bit:
            state["scale"] = self.sign_scale_
        return state

    def _signs(self, dimension: int) -> Tensor:
        return 2 * bits.unpack(self.weight_, dimension).float() - 1
