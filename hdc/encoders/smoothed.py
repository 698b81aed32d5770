"""Frames smoothed by a Gaussian in integers, before another encoder."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.encoders.named import Around
from hdc.encoders.relative import EXACT, LARGEST, integers
from hdc.parameters import check_integer
from hdc.tensors import checked

_MOST = 16  # pixels of deviation
_REACH = 3  # deviations up to which pixels count
_WEIGHT = 12  # the weights along an axis have the sum 2¹²
_STEP = 2**20  # pixels of several frames at a time; 8 bytes each, several times
_EXACT_BITS = 8 + 2 * _WEIGHT - LARGEST  # dropped from sums of whole grey values


class Smoothed(Around):
    """Smooths each image, and encodes the result by another encoder.

    A pixel becomes the weighted mean of its neighbourhood, along columns and then along rows, with
    the weights of a Gaussian up to three deviations away, in whole numbers of 1/4096; beyond an
    edge the image is mirrored at its outermost pixels. The mean is rounded to 1/1024 of a grey
    value, or, for floats, to 18 bits. All arithmetic is in integers, so every machine computes the
    same bits. Rounding of grey values by a codec or a conversion then affects few bits, and so do
    details of about one pixel.

    Args:
        base: the encoder of the smoothed frames, a name or an object.
        smooth: deviation of the Gaussian in pixels, from 1 to 16.

    Attributes:
        shape_: int64 [2], rows and columns of a frame.

    Example:
        >>> import torch
        >>> frames = torch.zeros(2, 3, 5, dtype=torch.uint8)
        >>> frames[0, :, 1] = frames[1, :, 3] = 9
        >>> words = Smoothed("median", 1).fit(frames).encode(frames)
        >>> words[0] == words[1]
        tensor([False])
    """

    revision: ClassVar[int] = 2
    learns: ClassVar[bool] = True

    shape_: Tensor

    def __init__(self, base: Any = "deviation", smooth: int = 1):
        self.base = base
        self.smooth = smooth

    def check(self) -> None:
        check_integer("smooth", self.smooth, 1, _MOST)
        super().check()

    def fit(self, frames: Any) -> Self:
        """Learn the shape of images [N, H, W], and train the other encoder on smoothed images.

        Raises:
            ValueError: for frames that are no images.
        """
        shape = tuple(frames.shape[1:])
        if len(shape) != 2:
            raise ValueError(
                f"smooth: expected images [N, H, W], found frames of shape {shape}"
            )
        self.shape_ = torch.tensor(shape)
        if self.base_.learns:
            self.base_.fit(_Frames(self, frames))
        return self

    def encode(self, frames: Tensor, first: int = 0) -> Tensor:
        """Hypervectors of smoothed frames; see :meth:`hdc.encoders.ranks.RankEncoder.encode`."""
        return self.encode_by_base(self.images(frames, first), first)

    def images(self, frames: Tensor, first: int = 0) -> Tensor:
        """Smoothed images int32 [N, H, W] of frames [N, H, W] or [N, D].

        In 1/1024 of a grey value for types of at most 16 bits, otherwise scaled to 18 bits.
        """
        inputs.check_frames(frames)
        flat = frames.flatten(1)
        height, width = self.shape_.tolist()
        found = torch.empty(flat.shape, dtype=torch.int32, device=frames.device)
        step = max(1, _STEP // flat.shape[1])
        weights = gaussian(self.smooth)
        surplus = _EXACT_BITS if frames.dtype in EXACT else 2 * _WEIGHT
        half = 1 << (surplus - 1)
        for start in range(0, len(flat), step):
            part = integers(flat[start : start + step], first + start)
            images = part.view(-1, height, width)
            total = _along(_along(images, weights, 1), weights, 2)
            found[start : start + step] = ((total + half) >> surplus).flatten(1)
        return found.view(-1, height, width)

    def state(self) -> dict[str, Tensor]:
        return {"shape": self.shape_, **self.base_.state()}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        others = dict(tensors)
        shape = checked({"shape": others.pop("shape")}, {"shape": "int64 2"})["shape"]
        if int(shape.min()) < 1 or math.prod(shape.tolist()) != n_pixels:
            raise ValueError(
                f"shape: expected that of {n_pixels} pixels, found {shape.tolist()}"
            )
        self.shape_ = shape
        self.base_.restore(others, n_pixels)


class _Frames:
    """Frames that are smoothed when a slice is taken."""

    def __init__(self, encoder: Smoothed, frames: Any) -> None:
        self.shape = tuple(frames.shape)
        self._encoder = encoder
        self._frames = frames

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, chosen: slice) -> Tensor:
        part = inputs.tensor(self._frames[chosen])
        return self._encoder.images(part, chosen.start or 0)


@functools.cache
def gaussian(deviation: int) -> tuple[int, ...]:
    """Integer weights of the pixels from −3σ to 3σ, with the sum 2¹²."""
    reach = _REACH * deviation
    heights = [math.exp(-0.5 * (k / deviation) ** 2) for k in range(-reach, reach + 1)]
    unit = 2**_WEIGHT / sum(heights)
    weights = [round(height * unit) for height in heights]
    weights[reach] += 2**_WEIGHT - sum(weights)
    return tuple(weights)


def _along(images: Tensor, weights: tuple[int, ...], axis: int) -> Tensor:
    """Weighted sums along an axis of images int64 [N, H, W]."""
    n = images.shape[axis]
    reach = len(weights) // 2
    around = np.pad(np.arange(n), reach, "reflect")
    padded = images.index_select(axis, torch.from_numpy(around).to(images.device))
    total = torch.zeros_like(images)
    for k, weight in enumerate(weights):
        total.add_(padded.narrow(axis, k, n), alpha=weight)
    return total
