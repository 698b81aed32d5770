"""Thresholds in units of a frame's own deviation from a reference frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import torch
from torch import Tensor

from hdc import backends, bits
from hdc.encoders.ranks import warn_of_constant
from hdc.encoders.relative import RelativeEncoder, moments

_LARGEST = 10**6  # numerator or denominator of a threshold
_INT32 = torch.iinfo(torch.int32).max


class Deviation(RelativeEncoder):
    """T bits per pixel: whether it exceeds the reference by more than some standard deviations.

    With d the standardised frame minus the reference, both in steps of 2⁻¹⁶ as of
    :class:`hdc.encoders.Reference`, and σ the standard deviation of the frame's D values d, rounded
    down to such a step, bit t·D + j is d_j > thresholds[t]·σ. A value that equals its threshold
    becomes a zero. All arithmetic is in integers, so every machine computes the same bits. Unlike
    ranks, the bits show how much of the frame differs from the reference.

    Args:
        thresholds: T rising numbers of at most six digits, in standard deviations.
        frame: as of :class:`hdc.encoders.Reference`.

    Attributes:
        reference_: int32 [D], the reference in steps of 2⁻¹⁶ of a standard deviation.

    Example:
        >>> import torch
        >>> frames = torch.tensor([[9, 5, 5, 1], [1, 5, 5, 9]], dtype=torch.uint8)
        >>> words = Deviation([-1, 0, 1]).fit(frames).encode(frames[:1])
        >>> bits.unpack(words, 12).int().view(3, 4).tolist()
        [[1, 1, 1, 0], [1, 0, 0, 0], [1, 0, 0, 0]]
    """

    def __init__(
        self,
        thresholds: Sequence[Any] = (-1.5, -1, -0.5, 0, 0.5, 1, 1.5),
        frame: Any = None,
    ):
        self.thresholds = thresholds
        self.frame = frame

    def check(self) -> None:
        self.fractions()

    def fractions(self) -> list[Fraction]:
        """The thresholds as they are written: 0.1 is 1/10.

        Raises:
            ValueError: for anything but rising numbers of at most six digits.
        """
        given = self.thresholds
        found = _exact(given) if isinstance(given, list | tuple) else []
        if not found or found != sorted(set(found)):
            raise ValueError(
                "thresholds: expected a list of rising numbers of at most six digits, such as "
                f"[-1, 0, 1], found {given!r}"
            )
        return found

    def dimension(self, n_pixels: int) -> int:
        return len(self.thresholds) * n_pixels

    def of_differences(self, differences: Tensor, first: int) -> Tensor:
        deviations = deviations_of(differences)
        none = [i for i, sigma in enumerate(deviations) if sigma == 0]
        if none:
            warn_of_constant(none, first)
        thresholds = self.fractions()
        levels = [[_level(t, sigma) for t in thresholds] for sigma in deviations]
        n, n_pixels = differences.shape
        limits = torch.tensor(levels, dtype=torch.int32, device=differences.device)
        limits = limits.view(n, len(thresholds))
        kernels = backends.in_use.get()
        if not kernels:
            above = differences[:, None] > limits[..., None]
            return bits.pack(above.flatten(1))
        words = torch.empty(
            n, bits.words_for(len(thresholds) * n_pixels), dtype=torch.int64
        )
        kernels.exceed(differences.numpy(), limits.numpy(), words.numpy())
        return words


def deviations_of(differences: Tensor) -> list[int]:
    """Standard deviations of rows int32 [N, D], rounded down.

    The values d of a row have Σ d² below 2⁵⁹ at D = 2²⁴ + 1, since standardised frames and their
    mean have Σ x² ≤ 2³²·D, but for rounding; and |Σ d| ≤ 2·D.
    """
    n = differences.shape[1]
    totals, squares = moments(differences)
    variances = (squares - (totals * totals + n - 1) // n) // n  # rounded down
    # Below zero only where a damaged reference made sums overflow.
    return [math.isqrt(max(0, variance)) for variance in variances.tolist()]


def _level(threshold: Fraction, sigma: int) -> int:
    """⌊threshold·σ⌋, clipped to the range of int32."""
    return max(-_INT32, min(_INT32, math.floor(threshold * sigma)))


def _exact(values: Sequence[Any]) -> list[Fraction]:
    """Numbers as they are written; [] if one is no number, or has more than six digits."""
    try:
        found = [Fraction(str(value)) for value in values]
    except (ValueError, ZeroDivisionError):
        return []
    sizes = [max(abs(value.numerator), value.denominator) for value in found]
    return found if max(sizes, default=0) <= _LARGEST else []
