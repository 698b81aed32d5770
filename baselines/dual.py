"""Linear classifiers solved in the space of samples instead of the space of pixels.

With N frames of D pixels and N ≪ D, the weights that minimise any loss with an L2 penalty are
combinations of the training frames, W = Aᵀ·X (representer theorem), so that the N×N Gram matrix
K = X·Xᵀ of the centred frames carries the whole problem, however many pixels there are. Centring
loses nothing, since the intercept b is not penalised and takes up any shift.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier, FrameSource
from baselines.integer import integer_product
from baselines.pixels import PixelScaling, fit_scaling

PIXELS = 32768  # columns of the frames handled at a time
FRAMES = 20  # rows turned into floats at a time


@dataclass(kw_only=True, eq=False)
class DualLinearClassifier(Classifier):
    """A linear classifier whose subclass writes ``solve``.

    The frames stay bytes, and all N of them are held at once. One pass makes K, exact in integers
    for all but ``standard`` pixels; a second makes the weights.

    Args:
        pixels: one of the scalings in baselines.pixels, by name.
        device: where it is computed; needs float64.

    Attributes:
        weight_: float32 [L, D], for pixels as the camera gives them (the scaling is folded in).
        bias_: float32 [L].
        coefficients_: A, float64 [N, L], each column summing to zero.
    """

    pixels: str = "unit"

    @abstractmethod
    def solve(self, gram: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, float]:
        """A [N, L], b [L] and the loss from K float64 [N, N] and class indices int64 [N]."""

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N, epoch = 1 and the loss."""
        targets = self.start(frames, labels)
        scaling = fit_scaling(self.pixels, self, frames)
        images = self.read(frames, slice(0, len(frames))).flatten(1)
        coefficients, bias, loss = self.solve(centred_gram(images, scaling), targets)
        # Exactly zero-sum columns leave the mean frame no part in the weights.
        self.coefficients_ = coefficients - coefficients.mean(dim=0)
        self.weight_, mean = self._weights(images, scaling)
        self.bias_ = (bias - self.weight_.double() @ mean.double()).float()
        yield {"samples_seen": len(frames), "epoch": 1.0, "loss": loss}

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b, float32 [n, L]."""
        return torch.addmm(self.bias_, batch.flatten(1).float(), self.weight_.T)

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, D] and bias [L]."""
        return {"weight": self.weight_, "bias": self.bias_}

    def _weights(self, images: Tensor, scaling: PixelScaling) -> tuple[Tensor, Tensor]:
        """Weights [L, D] and the mean frame [D] in one pass over the frames."""
        n = len(images)
        mean_row = torch.full((n, 1), 1 / n, dtype=torch.float64, device=images.device)
        combine = torch.cat([self.coefficients_, mean_row], dim=1).T.float().contiguous()
        sums = torch.zeros(len(combine), images.shape[1], device=images.device)
        for start in range(0, n, FRAMES):
            rows = slice(start, start + FRAMES)
            sums.addmm_(combine[:, rows], images[rows].float())
        scale = scaling.scale
        squared = scale.flatten() ** 2 if isinstance(scale, Tensor) else scale**2
        return sums[:-1].mul_(squared), sums[-1]


def centred_gram(images: Tensor, scaling: PixelScaling) -> Tensor:
    """K = H·X·Xᵀ·H, float64 [N, N], X the scaled frames [N, D] and H = 1 − 11ᵀ/N.

    Args:
        images: uint8 or int32 [N, D].
        scaling: a single scale for all pixels keeps the product in integers.
    """
    if isinstance(scaling.scale, Tensor):
        gram = _scaled_gram(images, scaling)
    else:
        gram = _integer_gram(images).mul_(scaling.scale**2)
    gram -= gram.mean(dim=0)
    gram -= gram.mean(dim=1, keepdim=True)
    return gram


def _integer_gram(images: Tensor) -> Tensor:
    """Gram matrix of the frames shifted by a constant, exact; float64 [N, N]."""
    n, d = images.shape
    wide = images.dtype != torch.uint8
    gram = torch.zeros((1 + wide) * n, (1 + wide) * n, dtype=torch.float64, device=images.device)
    for start in range(0, d, PIXELS):
        block = images[:, start : start + PIXELS]
        if wide:  # 16-bit pixels are 256·high + low
            block = torch.cat([block >> 8, block & 255]).to(torch.uint8)
        shifted = (block ^ 128).view(torch.int8)  # 0…255 → −128…127
        gram += integer_product(shifted, shifted.T)
    if not wide:
        return gram
    high, low = slice(0, n), slice(n, 2 * n)
    return 65536 * gram[high, high] + 256 * (gram[high, low] + gram[low, high]) + gram[low, low]


def _scaled_gram(images: Tensor, scaling: PixelScaling) -> Tensor:
    """Gram matrix of frames scaled pixel by pixel, float32 products summed in float64.

    A constant a pixel, the shift of the scaling, is left out: centring takes it away.
    """
    assert isinstance(scaling.scale, Tensor)
    assert isinstance(scaling.offset, Tensor)
    offset, scale = scaling.offset.flatten(), scaling.scale.flatten()
    gram = torch.zeros(len(images), len(images), dtype=torch.float64, device=images.device)
    block = PIXELS // 8  # short sums, so that float32 rounds little before float64 takes over
    for start in range(0, images.shape[1], block):
        columns = slice(start, start + block)
        scaled = (images[:, columns].float() - offset[columns]).mul_(scale[columns])
        gram += scaled @ scaled.T
    return gram
