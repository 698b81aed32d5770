"""Frames relative to a reference frame: what a laboratory calls zeroing."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.encoders.base import Encoder
from hdc.encoders.ranks import check_finite, check_frames, warn_of_constant
from hdc.io import check_tensors

FRACTION = 16  # bits after the point of a standardised pixel
_LARGEST = 18  # bits that floating-point pixels are scaled to
_STEP = 2**22  # pixels of several frames at a time; 8 bytes each, several times
# A pixel below the first is rounded to 0.
_POWERS = [2.0**k for k in range(-2, _LARGEST + 1)]
_EXACT = (torch.uint8, torch.int8, torch.int16, torch.uint16)


GIVEN = "given"
"""Stands in a file for a frame that was given."""


class Reference(Encoder):
    """Standardises each frame, subtracts a reference frame, and asks another encoder.

    A standardised frame is (x − mean(x))/std(x), in steps of 2⁻¹⁶. The reference is the mean of the
    standardised training frames, or of the frames given to :meth:`zero`, such as some without a
    touch. All arithmetic is in integers, so every machine has the same bits. Subtracting a mean
    frame before a decision is unsupervised re-centring (Vidaurre et al., IEEE TBME 58, 587 (2011)),
    here before the threshold.

    Args:
        base: the encoder of the differences, a name or an object; one that learns nothing.
        frame: reference frame [H, W] or [D], or several [n, H, W] or [n, D], whose mean after each
            was standardised is the reference; by default learned of the training frames. A saved
            model keeps what it made of the frames, not the frames: loaded, it is ``"given"``, and
            :meth:`fit` asks for them anew.

    Attributes:
        reference_: int64 [D], the reference in steps of 2⁻¹⁶ of a standard deviation.
    """

    learns: ClassVar[bool] = True
    stand_ins: ClassVar = {"frame": GIVEN}

    reference_: Tensor

    def __init__(self, base: Any = "median", frame: Any = None):
        self.base = base
        self.frame = frame

    @property
    def parts(self) -> Mapping[str, Callable[[Any], Any]]:  # type: ignore[override]
        from hdc.encoders import make_encoder

        return {"base": functools.partial(make_encoder, what="base")}

    @property
    def base_(self) -> Encoder:
        """The encoder of the differences."""
        kept = getattr(self, "_base", None)
        if kept is None or kept[0] is not self.base:  # set since
            kept = self._base = self.base, self.parts["base"](self.base)
        return kept[1]

    def check(self) -> None:
        self.base_.check()
        if self.base_.learns:
            raise ValueError(
                f"base: expected an encoder that learns nothing, found {self.base_!r}"
            )

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
        self.reference_ = total // len(frames)
        return self

    def dimension(self, n_pixels: int) -> int:
        return self.base_.dimension(n_pixels)

    def encode(
        self,
        frames: Tensor,
        first: int = 0,
        backend: str = "numpy",
        out: Tensor | None = None,
    ) -> Tensor:
        """As of :meth:`hdc.encoders.ranks.RankEncoder.encode`, of the differences."""
        from hdc.encoders import encode_with

        reference = self.reference_.to(frames.device, torch.int32)
        constant: list[int] = []
        words = []
        step = _frames_at_a_time(frames)
        for start in range(0, max(1, len(frames)), step):
            part = frames[start : start + step]
            values = standardised(part, first + start)
            flat = (~values.any(1)).nonzero().flatten()
            constant += (start + flat).tolist()
            difference = values - reference
            words.append(encode_with(self.base_, difference, first + start, "numpy"))
        warn_of_constant(constant, first)
        whole = torch.cat(words)
        if out is None:
            return whole
        out[: len(whole)] = whole
        return out[: len(whole)]

    def state(self) -> dict[str, Tensor]:
        return {"reference": self.reference_}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        check_tensors(tensors, {"reference": (n_pixels,)})
        self.reference_ = tensors["reference"]


class ReferenceLevels(Reference):
    """Levels of each frame less a reference frame: :class:`Reference` with ``base="levels"``.

    Args: as of :class:`Reference`.
    """

    def __init__(self, base: Any = "levels", frame: Any = None):
        super().__init__(base, frame)


def _frames_at_a_time(frames: Any) -> int:
    n_pixels = math.prod(frames.shape[1:])
    return max(1, _STEP // max(1, n_pixels))


def standardised(frames: Tensor, first: int = 0) -> Tensor:
    """(x − mean(x))/std(x) in steps of 2⁻¹⁶, rounded down, int32 [N, D]; a constant frame is 0.

    With S = Σ x and Q = Σ x² it is (D·x − S)·2¹⁶ over the integer square root of D·Q − S²: whole
    numbers below 2⁵³, whose one division rounds alike on every machine. Floating point and types of
    more than 16 bits are first scaled to integers of 18 bits, frame by frame.
    """
    check_frames(frames)
    flat = frames.reshape(len(frames), -1)
    if flat.dtype == torch.uint8:
        values = torch.empty(flat.shape, dtype=torch.int32, device=flat.device)
        for frame, row in zip(flat, values, strict=True):
            torch.index_select(_values_of_greys(frame), 0, frame.int(), out=row)
        return values
    pixels = _integers(flat, first)
    squares = (pixels * pixels).sum(1)
    return _in_steps(pixels, pixels.sum(1), squares, flat.shape[1])


def _values_of_greys(frame: Tensor) -> Tensor:
    """What each grey value 0…255 becomes in a frame uint8 [D]: int32 [256]."""
    greys = torch.arange(256, device=frame.device)
    counts = torch.bincount(frame, minlength=256)
    total = (counts * greys).sum()
    square = (counts * greys * greys).sum()
    return _in_steps(greys[None], total[None], square[None], len(frame))[0]


def _in_steps(pixels: Tensor, sums: Tensor, squares: Tensor, n_pixels: int) -> Tensor:
    """Pixels int64 [N, k] of frames of so many pixels, with sums [N] of all of them and of their
    squares, in steps of 2⁻¹⁶ deviations: int32 [N, k]."""
    deviations = []
    for total, square in zip(sums.tolist(), squares.tolist(), strict=True):
        deviation = math.isqrt(n_pixels * square - total**2)
        deviations.append(max(1, deviation))
    divisors = torch.tensor(deviations, dtype=torch.float64, device=pixels.device)
    centred = n_pixels * pixels - sums[:, None]
    scaled = centred.double() * 2**FRACTION
    return (scaled / divisors[:, None]).floor().to(torch.int32)


def _integers(pixels: Tensor, first: int) -> Tensor:
    """Pixels [N, D] as int64 of at most 18 bits; those of more are scaled, frame by frame."""
    if pixels.dtype in _EXACT:
        return pixels.to(torch.int64)
    values = pixels.double()
    if len(values):
        check_finite(values, first)
    mantissas, exponents = torch.frexp(values)
    _, largest = torch.frexp(values.abs().amax(1, keepdim=True))
    # Powers of two from a table: those that torch computes are of 32 bits, and end at 2¹²⁷.
    powers = torch.tensor(_POWERS, dtype=torch.float64, device=values.device)
    last = len(_POWERS) - 1
    # A zero has the exponent 0, whatever the other pixels are.
    places = (exponents - largest + last).clamp(min=0, max=last).long()
    scaled = mantissas * powers[places]
    return scaled.round().to(torch.int64)
