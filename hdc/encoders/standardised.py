"""Frames of mean 0 and deviation 1, in integers: every machine has the same ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.encoders.ranks import check_finite

FRACTION = 16  # bits after the point of a standardised pixel
_STEPS = 2.0**FRACTION
LARGEST = 18  # bits that floating-point pixels are scaled to
# A pixel below the first is rounded to 0.
_POWERS = [2.0**k for k in range(-2, LARGEST + 1)]
EXACT = (torch.uint8, torch.int8, torch.int16, torch.uint16)


def standardised(frames: Tensor, first: int = 0) -> Tensor:
    """(x − mean(x))/std(x) in steps of 2⁻¹⁶, rounded down, int32 [N, D]; a constant frame is 0.

    With S = Σ x and Q = Σ x² it is (D·x − S)·2¹⁶ over the integer square root of D·Q − S²: whole
    numbers below 2⁵³, whose one division rounds alike on every machine. Floating point and types of
    more than 16 bits first lose the middle of their range, so that no offset takes bits from what
    differs, and are scaled to integers of 18 bits, frame by frame.
    """
    inputs.check_frames(frames)
    flat = frames.flatten(1)
    n_pixels = flat.shape[1]
    kernels = backends.in_use.get()
    if kernels and flat.dtype in (torch.uint8, torch.uint16):
        images = flat.numpy()
        totals, squares = kernels.sums(images).T
        deviations = _deviations(totals, squares, n_pixels)
        divisors = np.array(deviations, np.float64)
        values = kernels.in_steps(images, totals.astype(float), divisors, _STEPS)
        return torch.from_numpy(values)
    pixels = integers(flat, first)
    squares = (pixels * pixels).sum(1)
    return _in_steps(pixels, pixels.sum(1), squares, n_pixels)


def _in_steps(pixels: Tensor, sums: Tensor, squares: Tensor, n_pixels: int) -> Tensor:
    """Pixels int64 [N, k] of frames of so many pixels, with sums [N] of all of them and of their
    squares, in steps of 2⁻¹⁶ deviations: int32 [N, k]."""
    deviations = _deviations(sums, squares, n_pixels)
    divisors = torch.tensor(deviations, dtype=torch.float64, device=pixels.device)
    values = pixels.double().mul_(n_pixels).sub_(sums[:, None])  # in place, still whole
    return values.mul_(_STEPS).div_(divisors[:, None]).floor_().to(torch.int32)


def _deviations(sums: Any, squares: Any, n_pixels: int) -> list[int]:
    """√(D·Q − S²) of sums S and of squares Q of frames [N], rounded down; 1 of a constant frame."""
    pairs = zip(sums.tolist(), squares.tolist(), strict=True)
    return [max(1, math.isqrt(n_pixels * q - s**2)) for s, q in pairs]


def integers(pixels: Tensor, first: int) -> Tensor:
    """Pixels [N, D] as int64 of at most 18 bits; those of more are centred and scaled, frame by
    frame."""
    if pixels.dtype in EXACT:
        return pixels.to(torch.int64)
    values = pixels.double()
    if len(values):
        check_finite(values, first)
    # The middle and not the mean: sums in floating point are rounded otherwise elsewhere.
    halves = values.amin(1, keepdim=True) / 2, values.amax(1, keepdim=True) / 2
    values = values - (halves[0] + halves[1])
    mantissas, exponents = torch.frexp(values)
    _, largest = torch.frexp(values.abs().amax(1, keepdim=True))
    # Powers of two from a table: those that torch computes are of 32 bits, and end at 2¹²⁷.
    powers = torch.tensor(_POWERS, dtype=torch.float64, device=values.device)
    last = len(_POWERS) - 1
    # A zero has the exponent 0, whatever the other pixels are.
    places = (exponents - largest + last).clamp(min=0, max=last).long()
    scaled = mantissas * powers[places]
    return scaled.round().to(torch.int64)
