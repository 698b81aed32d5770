"""A linear read-out of HDC's own bits: what majority voting is to be compared with.

A frame is the hypervector that HDC makes of it, the brighter half of its pixels +1 and the others
−1, and nothing else is known of it. On these bits HDC's prototype of a class is the sign of a sum
of its training frames, a linear read-out of one bit a weight; here ridge regression learns the
weights instead (see baselines.ridge), and they stay float32, or are reduced to as many bytes as
HDC's prototypes have: their signs, with a scale and a bias a class,

    s_c(x) = ‖w_c‖₁/D · sign(w_c)·(x − x̄) + b_c,

which is the nearest such vector to w_c (Rastegari et al., XNOR-Net, ECCV 2016, Eq. 6).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines import ridge
from baselines.base import Classifier, FrameSource
from baselines.integer import integer_product, pack, unpack

FRAMES = 20  # read and thresholded at a time
BYTES = 4096  # of the packed bits of all frames turned into numbers at a time


@dataclass(kw_only=True, eq=False)
class BitReadout(Classifier):
    """Ridge classifier of the thresholded pixels, ±1; its training frames are kept as bits.

    Args:
        alpha: strength of the penalty, above zero.
        one_bit: keep the signs of the weights only.

    Attributes:
        weight_: float32 [L, D]; with ``one_bit`` uint8 [L, ⌈D/8⌉], a bit a sign.
        scale_: float32 [L], with ``one_bit``.
        bias_: float32 [L].
    """

    alpha: float = 1.0
    one_bit: bool = False

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N, epoch = 1 and the mean squared error."""
        onehot = F.one_hot(self.start(frames, labels))
        n = len(frames)
        packed = torch.cat(
            [pack(halves(self.read(frames, slice(k, k + FRAMES)))) for k in range(0, n, FRAMES)]
        )
        coefficients, bias, loss = ridge.solve(_centred_gram(packed), onehot, self.alpha)
        mean = torch.full((1, n), 1 / n, dtype=torch.float64, device=packed.device)
        combine = torch.cat([(coefficients - coefficients.mean(dim=0)).T, mean]).float()
        d = self.shape_[0] * self.shape_[1]
        sums = torch.cat([combine @ _signs(part).float() for part in _blocks(packed)], dim=1)[:, :d]
        weight, mean_frame = sums[:-1].contiguous(), sums[-1].double()
        self.scale_ = weight.abs().mean(dim=1)
        if self.one_bit:
            self.weight_ = pack(weight >= 0)
            weight = self.scale_[:, None] * _signs(self.weight_)[:, :d]
        else:
            self.weight_ = weight
        self.bias_ = (bias - weight.double() @ mean_frame).float()
        yield {"samples_seen": n, "epoch": 1.0, "loss": loss}

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b of the bits x, float32 [n, L]."""
        bits = 2 * halves(batch).float() - 1
        if not self.one_bit:
            return torch.addmm(self.bias_, bits, self.weight_.T)
        signs = _signs(self.weight_)[:, : bits.shape[1]].float()
        return torch.addcmul(self.bias_, self.scale_, bits @ signs.T)

    def state_tensors(self) -> dict[str, Tensor]:
        """weight and bias, and the scale of signs."""
        state = {"weight": self.weight_, "bias": self.bias_}
        return state | {"scale": self.scale_} if self.one_bit else state


def halves(frames: Tensor) -> Tensor:
    """The brighter half of each frame [n, …] of uint8 or int32: bool [n, D] with ⌊D/2⌋ ones.

    Of pixels equal to the last that fits the first are taken, in the order they lie in: as HDC does
    it, bit for bit.
    """
    images = frames.flatten(1)
    d = images.shape[1]
    # A histogram finds the value that ⌊D/2⌋ pixels reach ten times faster than sorting.
    rank = d - d // 2 + 1
    cuts = [torch.searchsorted(torch.bincount(row).cumsum(0), rank) for row in images]
    cut = torch.stack(cuts)[:, None].to(images.dtype)
    above, equal = images > cut, images == cut
    missing = d // 2 - above.sum(dim=1, keepdim=True)
    return above | (equal & (equal.cumsum(dim=1, dtype=torch.int32) <= missing))


def _centred_gram(packed: Tensor) -> Tensor:
    """K of the bits as ±1, exact before it is centred; float64 [N, N]."""
    gram = torch.zeros(len(packed), len(packed), dtype=torch.float64, device=packed.device)
    for part in _blocks(packed):
        signs = _signs(part)
        gram += integer_product(signs, signs.T)
    gram -= gram.mean(dim=0)
    gram -= gram.mean(dim=1, keepdim=True)
    return gram


def _blocks(packed: Tensor) -> Iterator[Tensor]:
    """Some columns of packed bits at a time; those that fill the last byte cancel by centring."""
    for start in range(0, packed.shape[1], BYTES):
        yield packed[:, start : start + BYTES].contiguous()


def _signs(packed: Tensor) -> Tensor:
    """Packed bits [n, B] as ±1, int8 [n, 8B]."""
    return 2 * unpack(packed) - 1
