"""Pixels to numbers: how grey values are scaled before a model sees them, by name.

===================  =================  ========================================================
``raw``              x                  0…255 (or 0…65535), as the camera gives them
``unit``             x / max            0…1, max = 255 or 65535
``unit_centred``     (x − μ) / max      minus the mean grey of all training frames, one number:
                                        with an intercept the same problem as ``unit``, but far
                                        less stiff, as the mean no longer acts as an intercept
``standardised``     (x − m) / s        each frame by its own mean m and standard deviation s:
                                        no brightness or contrast of a frame is left
``bits``             ±1                 HDC's hypervector of the frame: the ⌊D/2⌋ brightest
                                        pixels +1, the others −1
===================  =================  ========================================================

A constant frame has s = 0 and is divided by one.
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

CHUNK = 20  # frames summed at a time; float32 sums of so many pixels are exact


@dataclass(frozen=True)
class PixelScaling:
    """x ↦ (x − offset)·scale, two numbers for all pixels."""

    offset: float = 0.0
    scale: float = 1.0

    def __call__(self, batch: Tensor) -> Tensor:
        """Frames [n, H, W] → float32 of the same shape."""
        values = batch.float()  # a copy, so the rest can happen in place
        if self.offset != 0:
            values.sub_(self.offset)
        if self.scale != 1:
            values.mul_(self.scale)
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
    """Hypervectors of frames [n, H, W] as ±1, float32 of the same shape."""
    words = Median().encode(batch)
    mask = bits.unpack(words, batch.shape[1:].numel())
    return (2 * mask.float() - 1).view(batch.shape)


def fit_scaling(
    pixels: str, model: Classifier, frames: FrameSource
) -> Callable[[Tensor], Tensor]:
    """The scaling of that name, one of ``KERNELS``: frames [n, H, W] to float32 of the same shape.

    The model reads the training frames, of which ``unit_centred`` takes the mean; its ``start`` has
    been called.

    Raises:
        ValueError: for another name.
    """
    check_choice("pixels", pixels, KERNELS)
    if pixels == "standardised":
        return standardise
    if pixels == "bits":
        return signs
    scale = 1.0 if pixels == "raw" else 1 / FRAME_TYPES[model.frame_dtype_]
    if pixels != "unit_centred":
        return PixelScaling(scale=scale)
    exact = torch.float32 if model.frame_dtype_ == torch.uint8 else torch.float64
    total = torch.zeros(model.shape_, dtype=torch.float64, device=model.device)
    for start in range(0, len(frames), CHUNK):
        batch = model.read(frames, slice(start, start + CHUNK))
        total += batch.to(exact).sum(dim=0)
    return PixelScaling(total.mean().item() / len(frames), scale)
