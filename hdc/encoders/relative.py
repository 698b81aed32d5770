"""Standardised frames relative to a reference frame: in a laboratory, zeroing.

A standardised frame has mean 0 and standard deviation 1, in steps of 2⁻¹⁶. All arithmetic is in
integers, so that every machine computes the same frames.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.encoders.base import Encoder
from hdc.encoders.ranks import COMPILED, check_finite, warn_of_constant
from hdc.tensors import checked

FRACTION = 16  # bits after the point of a standardised pixel
_STEPS = 2.0**FRACTION
LARGEST = 18  # bits that floating-point pixels are scaled to
_GREYS = (torch.uint8, torch.uint16)
EXACT = (torch.uint8, torch.int8, torch.int16, torch.uint16)
GIVEN = "given"
"""Stands in a file for a reference frame that the user gave."""
_STEP = 2**18
"""Pixels at a time, of which a few arrays at 8 bytes per pixel fit in a processor's cache."""
_STEP_OF_MANY = 2**20  # for kernels, which share frames among threads, and for a GPU


class RelativeEncoder(Encoder):
    """Base class of encoders of standardised frames minus a reference frame.

    A subclass has the parameter `frame` and implements :meth:`of_differences`.

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

        `first` is the index of the first frame, for warnings.
        """

    def fit(self, frames: Any) -> Self:
        """Learn the mean of the standardised training frames, or of the given reference frames.

        Raises:
            ValueError: if given frames have another shape than the training frames, if there are
                none, or if the model was loaded from a file, which does not keep them.
        """
        if self.frame is None:
            return self.zero(frames)
        if isinstance(self.frame, str) and self.frame == GIVEN:
            raise ValueError(
                "frame: expected the reference frame that the model was given, which its file does "
                "not keep; set it, or None to learn one"
            )
        given = inputs.tensor(self.frame)
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
        """Set the reference to the mean of frames [N, H, W] or [N, D], standardised.

        Raises:
            ValueError: for no frames, or pixels that are not finite.
        """
        inputs.check_any(frames)
        total: Any = 0
        for start, part in _in_parts(frames):
            values = standardised(inputs.tensor(part), start)
            total = total + values.sum(0, dtype=torch.int64)
        self.reference_ = (total // len(frames)).to(torch.int32)
        return self

    def encode(self, frames: Tensor, first: int = 0) -> Tensor:
        """Hypervectors of the differences; see :meth:`hdc.encoders.ranks.RankEncoder.encode`."""
        reference = self._in_range(frames.shape[1:].numel()).to(frames.device)
        constant: list[int] = []
        words = []
        for start, part in _in_parts(frames):
            values = standardised(part, first + start)
            flat = (values[:, 0] == 0).nonzero().flatten()  # of few frames
            flat = flat[~values[flat].any(1)]
            constant += (start + flat).tolist()
            words.append(self.of_differences(values.sub_(reference), first + start))
        if constant:
            warn_of_constant(constant, first)
        return torch.cat(words)

    def _in_range(self, n_pixels: int) -> Tensor:
        """The reference, with zeros for values that no mean of standardised frames can have.

        Flipped bits of a damaged memory cause such values.
        """
        values = self.reference_
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
    """Upper bound of standardised pixels and of their means, in steps of 2⁻¹⁶."""
    return 2**FRACTION * (math.isqrt(n_pixels) + 1)


def _in_parts(frames: Any) -> Iterator[tuple[int, Any]]:
    """Frames, some at a time, each part with the index of its first; once for no frame."""
    many = backends.in_use.get() or getattr(frames, "is_cuda", False)
    n_pixels = math.prod(frames.shape[1:])
    step = max(1, (_STEP_OF_MANY if many else _STEP) // max(1, n_pixels))
    for start in range(0, max(1, len(frames)), step):
        yield start, frames[start : start + step]


# Standardised frames ------------------------------------------------------------------------------


def standardised(frames: Tensor, first: int = 0) -> Tensor:
    """(x − mean(x))/std(x) in steps of 2⁻¹⁶, rounded down, int32 [N, D]; a constant frame is 0.

    With S = Σ x and Q = Σ x² it is (D·x − S)·2¹⁶ over the integer square root of D·Q − S²: whole
    numbers below 2⁵³, whose only division is rounded alike on every machine. Frames of floats or of
    more than 16 bits are first centred on the middle of their range, so that an offset costs no
    precision, and scaled to integers of 18 bits, frame by frame.
    """
    inputs.check_frames(frames)
    flat = frames.flatten(1)
    n_pixels = flat.shape[1]
    pixels = flat if flat.dtype in _GREYS else integers(flat, first)
    sums, squares = moments(pixels)
    deviations = _deviations(sums, squares, n_pixels)
    deviation = torch.tensor(deviations, dtype=torch.float64, device=pixels.device)
    kernels = backends.in_use.get()
    if kernels and pixels.dtype in _GREYS:
        given = pixels.numpy(), sums.double().numpy(), deviation.numpy()
        return torch.from_numpy(kernels.in_steps(*given, _STEPS))
    values = pixels.double().mul_(n_pixels).sub_(sums[:, None])  # in place, still whole
    return values.mul_(_STEPS).div_(deviation[:, None]).floor_().to(torch.int32)


def moments(values: Tensor) -> tuple[Tensor, Tensor]:
    """Sums of integers [N, D] and of their squares: int64 [N] each."""
    kernels = backends.in_use.get()
    if kernels and values.dtype in COMPILED:
        sums, squares = torch.from_numpy(kernels.sums(values.numpy())).T
        return sums, squares
    values = values.long()
    return values.sum(1), (values * values).sum(1)


def _deviations(sums: Any, squares: Any, n_pixels: int) -> list[int]:
    """⌊√(D·Q − S²)⌋ from sums S [N] and sums of squares Q [N]; 1 for a constant frame."""
    pairs = zip(sums.tolist(), squares.tolist(), strict=True)
    return [max(1, math.isqrt(n_pixels * q - s**2)) for s, q in pairs]


def integers(pixels: Tensor, first: int) -> Tensor:
    """Pixels [N, D] as int64; types of more than 16 bits are centred and scaled to 18 bits."""
    if pixels.dtype in EXACT:
        return pixels.to(torch.int64)
    values = pixels.double()
    check_finite(values, first)
    # The middle, not the mean: machines round sums of floats differently.
    halves = values.amin(1, keepdim=True) / 2, values.amax(1, keepdim=True) / 2
    values = values - (halves[0] + halves[1])
    mantissas, exponents = torch.frexp(values)
    _, largest = torch.frexp(values.abs().amax(1, keepdim=True))
    # A zero has the exponent 0, whatever the other pixels are; pixels below 1/4 are rounded to 0.
    exponents = (exponents - largest + LARGEST).clamp(-2, LARGEST)
    # By shifts, since torch computes powers of two in 32 bits.
    scaled = mantissas * (1 << (exponents.long() + 2)) / 4
    return scaled.round().to(torch.int64)
