"""The base class of encoders relative to a reference frame: a laboratory calls this zeroing."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.encoders.base import Encoder
from hdc.encoders.ranks import warn_of_constant
from hdc.encoders.standardised import FRACTION, standardised
from hdc.tensors import checked

GIVEN = "given"
"""Stands in a file for a frame that was given."""
_STEP = 2**18
"""Pixels at a time, at 8 bytes each, several times: what the cache of a processor holds."""
_STEP_OF_MANY = 2**20  # of kernels, which share frames among threads, and of a GPU


class RelativeEncoder(Encoder):
    """Standardises each frame and subtracts a reference frame; a subclass makes bits of that.

    A subclass has the parameter `frame` and writes :meth:`of_differences`.

    Attributes:
        reference_: int32 [D], the reference in steps of 2⁻¹⁶ of a standard deviation.
    """

    revision: ClassVar[int] = 2
    learns: ClassVar[bool] = True
    numbered: ClassVar[bool] = True
    stand_ins: ClassVar = {"frame": GIVEN}

    frame: Any
    reference_: Tensor

    @abstractmethod
    def of_differences(self, differences: Tensor, first: int) -> Tensor:
        """Hypervectors int64 [N, W] of standardised frames minus the reference, int32 [N, D].

        `first` is the number of the first frame, in warnings.
        """

    def fit(self, frames: Any) -> Self:
        """Learn the mean of the standardised training frames, or take the frame or frames given.

        Raises:
            ValueError: for given frames of another shape than the training frames, none, or some
                that the file of the model does not keep.
        """
        if self.frame is None:
            return self.zero(frames)
        if isinstance(self.frame, str) and self.frame == GIVEN:
            raise ValueError(
                "frame: expected the reference frame that the model was given, which its file does "
                "not keep; set it, or None to learn one"
            )
        given = torch.as_tensor(np.asarray(self.frame))
        expected = tuple(frames.shape[1:])
        found = tuple(given.shape)
        if found == expected:
            return self.zero(given[None])
        if found[1:] != expected or found[0] == 0:
            raise ValueError(
                f"frame: expected a reference of shape {expected}, or several, found {found}"
            )
        return self.zero(given)

    def zero(self, frames: Any) -> Self:
        """Take the mean of these standardised frames [N, H, W] or [N, D] as the reference.

        Raises:
            ValueError: for no frames, or pixels that are not finite.
        """
        if len(frames) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        total: Any = 0
        step = _frames_at_a_time(frames)
        for start in range(0, len(frames), step):
            part = inputs.tensor(frames[start : start + step])
            values = standardised(part, start)
            total = total + values.sum(0, dtype=torch.int64)
        self.reference_ = (total // len(frames)).to(torch.int32)
        return self

    def encode(self, frames: Tensor, first: int = 0) -> Tensor:
        """Like :meth:`hdc.encoders.ranks.RankEncoder.encode`, for the differences."""
        reference = self._in_range(frames[:1].numel()).to(frames.device)
        constant: list[int] = []
        words = []
        step = _frames_at_a_time(frames)
        for start in range(0, max(1, len(frames)), step):
            part = frames[start : start + step]
            values = standardised(part, first + start)
            flat = (values[:, 0] == 0).nonzero().flatten()  # of few frames
            flat = flat[~values[flat].any(1)]
            constant += (start + flat).tolist()
            words.append(self.of_differences(values.sub_(reference), first + start))
        if constant:
            warn_of_constant(constant, first)
        return torch.cat(words)

    def _in_range(self, n_pixels: int) -> Tensor:
        """The reference, with zeros for values that no mean of standardised frames has.

        They come from flipped bits of a damaged memory.
        """
        values = self.reference_
        if len(values) == 0:
            return values
        most = _largest(n_pixels)
        return torch.where((values >= -most) & (values <= most), values, 0)

    def state(self) -> dict[str, Tensor]:
        return {"reference": self.reference_}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        given = tensors["reference"]
        kind = "int64 D" if given.dtype == torch.int64 else "int32 D"  # up to version 3
        found = checked(tensors, {"reference": kind}, D=n_pixels)["reference"]
        most = max(int(found.max()), -int(found.min()))
        if most > _largest(n_pixels):
            raise ValueError(
                f"reference: expected a mean of standardised frames, found {most}"
            )
        self.reference_ = found.to(given.device, torch.int32)


def _largest(n_pixels: int) -> int:
    """A bound of standardised pixels, and so of their means, in steps of 2⁻¹⁶ deviations."""
    return 2**FRACTION * (math.isqrt(n_pixels) + 1)


def _frames_at_a_time(frames: Any) -> int:
    many = backends.in_use.get() or getattr(frames, "is_cuda", False)
    n_pixels = math.prod(frames.shape[1:])
    return max(1, (_STEP_OF_MANY if many else _STEP) // max(1, n_pixels))
