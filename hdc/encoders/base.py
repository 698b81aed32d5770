"""The base class of encoders: frames to hypervectors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from torch import Tensor

from hdc.parameters import Parametrised


class Encoder(Parametrised, ABC):
    """Frames to packed hypervectors; an idea is a subclass in a file of its own.

    A subclass writes :meth:`encode`, and :meth:`dimension` where a hypervector has not one bit a
    pixel. One that learns something of the training frames writes :meth:`fit`, :meth:`state` and
    :meth:`restore`, too, and sets `learns`.

    Example:
        >>> import torch
        >>> from hdc import HDCClassifier, bits
        >>> class Bright(Encoder):
        ...     def encode(self, frames):
        ...         return bits.pack(frames.flatten(1) > 127)
        >>> frames = torch.randint(0, 255, (6, 8, 8), dtype=torch.uint8)
        >>> HDCClassifier(encoder=Bright()).fit(frames, [0, 1] * 3).encoder_
        Bright()
    """

    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the words of some frame."""
    learns: ClassVar[bool] = False
    """Whether :meth:`fit` learns anything of the frames."""
    numbered: ClassVar[bool] = False
    """Whether :meth:`encode` also takes the number of the first frame, for warnings and errors."""

    def check(self) -> None:
        """Raise ValueError, naming it, for a parameter that is not allowed."""

    def fit(self, frames: Any) -> Self:
        """Learn from training frames [N, H, W] or [N, D], anything with ``shape`` and slices."""
        return self

    @abstractmethod
    def encode(self, frames: Tensor) -> Tensor:
        """Hypervectors of frames [N, H, W] or [N, D]: int64 [N, ⌈bits/64⌉]."""

    def dimension(self, n_pixels: int) -> int:
        """Bits of the hypervector of a frame of so many pixels."""
        return n_pixels

    def state(self) -> dict[str, Tensor]:
        """The tensors that were learned, int64 or float64, to be saved."""
        return {}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        """Learn :meth:`state` of a file, of frames of so many pixels.

        Raises:
            ValueError: for tensors that do not fit.
        """
        if tensors:
            raise ValueError(f"tensors of an encoder that learns none: {list(tensors)}")
