"""Pixels to numbers: how grey values are scaled before a model sees them, by name.

===================  =================  ========================================================
``raw``              x                  0…255 (or 0…65535), as the camera gives them
``unit``             x / max            0…1, max = 255 or 65535
``unit_centred``     (x − μ) / max      minus the mean grey of all training frames, one number:
                                        with an intercept the same problem as ``unit``, but far
                                        less stiff, as the mean no longer acts as an intercept
``standard``         (x − μ) / σ        mean and standard deviation of each pixel over the
                                        training frames (scikit-learn's StandardScaler)
``standard_global``  (x − μ) / σ        one mean and standard deviation for all pixels
``standardised``     (x − m) / s        each frame by its own mean m and standard deviation s:
                                        no brightness or contrast of a frame is left
``bits``             ±1                 HDC's hypervector of the frame: the ⌊D/2⌋ brightest
                                        pixels +1, the others −1
===================  =================  ========================================================

A pixel or frame that never changes has σ = 0 and is divided by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.bank import KERNELS
from baselines.base import FRAME_TYPES, Classifier, FrameSource
from hdc import bits
from hdc.encoders import Median
from hdc.parameters import check_choice

SCALINGS = (*KERNELS, "standard")
CHUNK = 20  # frames; float32 sums of 20 squared 8-bit pixels are exact (20·255² < 2²⁴)


@dataclass
class PixelScaling:
    """x ↦ (x − offset)·scale − shift; each a number, or float32 [H, W].

    ``offset`` is the integer part of a mean, and ``shift`` the rest, scaled.
    """

    offset: float | Tensor = 0.0
    scale: float | Tensor = 1.0
    shift: float | Tensor = 0.0

    def __call__(self, batch: Tensor) -> Tensor:
        """Frames [n, H, W] → float32 of the same shape."""
        values = batch.float()  # a copy, so the rest can happen in place
        if isinstance(self.offset, Tensor) or self.offset != 0:
            values.sub_(self.offset)
        if isinstance(self.scale, Tensor) or self.scale != 1:
            values.mul_(self.scale)
        if isinstance(self.shift, Tensor):
            values.sub_(self.shift)
        return values


def standardise(batch: Tensor) -> Tensor:
    """Each frame [n, H, W] with mean 0 and standard deviation 1; a constant frame becomes 0."""
    values = batch.float().flatten(1)
    values -= values.mean(dim=1, keepdim=True)
    variance = values.square().mean(dim=1, keepdim=True)
    deviation = variance.sqrt_()
    values /= torch.where(deviation > 0, deviation, 1.0)
    return values.view(batch.shape)


def signs(batch: Tensor) -> Tensor:
    """Hypervectors of frames [n, H, W] as ±1, int8 of the same shape."""
    if not len(batch):
        return batch.to(torch.int8)
    words = Median().encode(batch)
    mask = bits.unpack(words, batch[0].numel())
    values = 2 * mask.to(torch.int8) - 1
    return values.view(batch.shape)


def fit_scaling(
    pixels: str, model: Classifier, frames: FrameSource
) -> Callable[[Tensor], Tensor]:
    """The scaling of that name, from frames [n, H, W] to float32 of the same shape.

    The model reads the training frames, from which some scalings take a mean; its ``start`` has
    been called. A ValueError lists the names.
    """
    check_choice("pixels", pixels, SCALINGS)
    unit = 1 / FRAME_TYPES[model.frame_dtype_]
    if pixels in ("raw", "unit"):
        return PixelScaling(scale=1.0 if pixels == "raw" else unit)
    if pixels == "standardised":
        return standardise
    if pixels == "bits":
        return lambda batch: signs(batch).float()
    # Σx and Σx² in whole numbers up to 2⁵³: nothing cancels that float64 has not kept.
    exact = torch.float32 if model.frame_dtype_ == torch.uint8 else torch.float64
    total = torch.zeros(model.shape_, dtype=torch.float64, device=model.device)
    squares, n = torch.zeros_like(total), len(frames)
    for start in range(0, n, CHUNK):
        batch = model.read(frames, slice(start, start + CHUNK)).to(exact)
        total += batch.sum(dim=0)
        squares += batch.square_().sum(dim=0)
    if pixels == "unit_centred":
        return PixelScaling(total.mean().item() / n, unit)
    if pixels == "standard_global":
        values = n * total.numel()
        overall = total.sum() / values
        deviation = _deviation(squares.sum() / values - overall**2)
        return PixelScaling(overall.item(), 1 / deviation.item())
    deviation = _deviation((n * squares - total**2) / n**2)
    # The difference of whole numbers is exact in float32; a mean of 16-bit pixels would lose what a
    # nearly constant pixel differs by.
    mean = total / n
    whole = mean.round()
    shift = (mean - whole) / deviation
    scale = 1 / deviation
    return PixelScaling(whole.float(), scale.float(), shift.float())


def _deviation(variance: Tensor) -> Tensor:
    # Integers up to 2³² per pixel: a true variance is never below 1/N², rounding is far below it.
    deviation = variance.clamp(min=1e-9).sqrt()
    return torch.where(variance > 1e-9, deviation, 1.0)
