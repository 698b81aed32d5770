"""Pixels to numbers: how grey values are scaled before a model sees them, by name.

===================  =================  ========================================================
``raw``              x                  0…255 (or 0…65535), as the camera gives them
``unit``             x / max            0…1, max = 255 or 65535
``standardised``     (x − m) / s        each frame by its own mean m and standard deviation s:
                                        no brightness or contrast of a frame is left
===================  =================  ========================================================

A constant frame has s = 0 and is divided by one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from baselines.bank import KERNELS
from baselines.base import FRAME_TYPES
from hdc.parameters import check_choice


def scaling(pixels: str, dtype: torch.dtype) -> Callable[[Tensor], Tensor]:
    """The scaling of that name, one of ``KERNELS``: frames [n, H, W] to float32 of the same shape.

    Args:
        pixels: the name.
        dtype: of the frames.

    Raises:
        ValueError: for another name.
    """
    check_choice("pixels", pixels, KERNELS)
    if pixels == "standardised":
        return standardise
    if pixels == "raw":
        return Tensor.float
    return partial(_times, scale=1 / FRAME_TYPES[dtype])


def _times(batch: Tensor, scale: float) -> Tensor:
    return batch.float().mul_(scale)  # float() makes a copy


def standardise(batch: Tensor) -> Tensor:
    """Each frame [n, H, W] with mean 0 and standard deviation 1; a constant frame becomes 0."""
    values = batch.float().flatten(1)
    values -= values.mean(dim=1, keepdim=True)
    variance = values.square().mean(dim=1, keepdim=True)
    deviation = variance.sqrt_()
    values /= torch.where(deviation > 0, deviation, 1.0)
    return values.view(batch.shape)
