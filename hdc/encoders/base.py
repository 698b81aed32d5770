"""The base class of encoders: frames to hypervectors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from torch import Tensor

from hdc.parameters import Part


class Encoder(Part, ABC):
    """Base class of encoders: packed hypervectors from frames.

    A subclass implements :meth:`encode`, and :meth:`dimension` unless a hypervector has one bit per
    pixel. If it learns from the training frames, it also implements :meth:`fit`, :meth:`state` and
    :meth:`restore`, and sets `learns`.

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

    learns: ClassVar[bool] = False
    """Whether :meth:`fit` learns from the frames."""
    numbered: ClassVar[bool] = False
    """Whether :meth:`encode` also takes the index of the first frame, for warnings and errors."""

    def fit(self, frames: Any) -> Self:
        """Learn from training frames [N, H, W] or [N, D], any object with ``shape`` and slices."""
        return self

    @abstractmethod
    def encode(self, frames: Tensor) -> Tensor:
        """Hypervectors of frames [N, H, W] or [N, D]: int64 [N, ⌈bits/64⌉]."""

    def dimension(self, n_pixels: int) -> int:
        """D, the bits of a hypervector, for frames of this number of pixels."""
        return n_pixels

    def state(self) -> dict[str, Tensor]:
        """The learned tensors, int64 or float64, to be saved."""
        return {}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        """Set the learned tensors from a file, for frames of this number of pixels.

        Raises:
            ValueError: for tensors that do not fit.
        """
        if tensors:
            raise ValueError(f"tensors of an encoder that learns none: {list(tensors)}")
