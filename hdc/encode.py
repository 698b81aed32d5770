"""Frames to hypervectors: threshold each frame at its own median, with exactly half ones.

The paper thresholds a speckle pattern so that 0 and 1 appear with the same probability. Thousands
of the 250,000 pixels of an 8-bit frame equal the median, so a plain comparison leaves 49.4 % ones;
here exactly k = ⌊D/2⌋ pixels become one: those above the k-th largest value m, and of those equal
to m the first in raster order. The order has to be the same for every frame and nothing else: a
Hamming distance does not know where in the image a pixel lies.

On the CPU only a sample is sorted. Its order says about where m lies (Floyd and Rivest, Commun. ACM
18, 165 (1975)); one pass over the frame counts the pixels above a value and so says on which side.
Two or three passes leave the pixels of one grey level, or some thousands of many levels, among
which the rest are selected. The counts of all pixels decide, so the sample changes no bit.
"""

from __future__ import annotations

import functools
import math
import warnings
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits

_STEP = 2**20  # pixels of several frames thresholded at once, at up to 30 bytes each
_SMALL = 4096  # pixels a frame up to which that is faster than one frame after another
_SAMPLE = 4096  # pixels of a frame that are sorted, at most
_PASSES = 12  # over a frame, before what is left is selected however much it is


def encode(
    frames: Tensor, first: int = 0, backend: str = "numpy", out: Tensor | None = None
) -> Tensor:
    """Hypervectors of frames: [N, H, W] or [N, D] of any real or integer dtype → int64 [N, ⌈D/64⌉].

    Each hypervector has exactly ⌊D/2⌋ ones. A constant frame carries no information; it gets its
    ones by the order of pixels alone, and a warning names it. Warnings and errors count frames from
    `first`, for frames that are a part of more. ``backend="compiled"`` encodes 8-bit frames on the
    CPU by :mod:`hdc.compiled`, with the same result; other types take the same way as without.
    Words of an `out` of at least as many rows are overwritten and returned, for frames that come
    in parts: new memory takes long to come by.

    Besides the result it takes some bytes a pixel of one frame (or of 2^20 pixels), however many
    frames there are; only ``"compiled"`` copies frames that do not lie in one piece.

    Raises:
        ValueError: for a shape other than the above, no pixels, pixels that are not finite, or a
            backend that is not to be had (:func:`hdc.bits.kernels`).
        TypeError: for a dtype that has no order (bool, complex).
    """
    kernels = bits.kernels(backend, frames.device)
    if frames.ndim not in (2, 3) or 0 in frames.shape[1:]:
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D] with pixels, found {tuple(frames.shape)}"
        )
    if frames.dtype == torch.bool or frames.is_complex():
        raise TypeError(f"frames: expected real or integer pixels, found {frames.dtype}")
    n, dimension = len(frames), frames.shape[1:].numel()
    width = bits.words_for(dimension)
    if out is None:
        out = torch.empty(n, width, dtype=torch.int64, device=frames.device)
    words = out[:n]
    constant: list[int] = []
    if kernels and frames.dtype == torch.uint8 and dimension > 1:
        constant = kernels.encode_uint8(frames.reshape(n, dimension).numpy(), words.numpy())
    else:
        step = max(1, _STEP // dimension)
        route = _encode_torch
        if frames.device.type == "cpu":
            route = _encode_small if dimension <= _SMALL else _encode_large
        for start in range(0, n, step):
            block = slice(start, start + step)
            flat = route(_pixels(frames[block], first + start), words[block])
            constant += [start + i for i, is_flat in enumerate(flat) if is_flat]
    if constant:
        listed = ", ".join(str(first + i) for i in constant[:10]) + (
            ", …" if len(constant) > 10 else ""
        )
        warnings.warn(
            f"{len(constant)} constant frame(s), at index {listed}: every pixel is equal, "
            "so the hypervector carries no information",
            stacklevel=2,
        )
    return words


def _pixels(frames: Tensor, first: int) -> Tensor:
    """Pixels [B, D] of a few frames, known to be finite, in a type that numpy can compare."""
    pixels = frames.detach().reshape(len(frames), -1)
    if not pixels.is_floating_point():
        return pixels
    if pixels.dtype not in (torch.float32, torch.float64):
        pixels = pixels.float()  # exact
    # On the CPU without torch's threads: waiting for a busy core takes longer than the frame.
    values = pixels.numpy() if pixels.device.type == "cpu" else pixels
    if not (math.isfinite(values.min()) and math.isfinite(values.max())):  # NaN is both
        index = int((~pixels.isfinite().all(1)).nonzero()[0])
        value = pixels[index][~pixels[index].isfinite()][0].item()
        found = "NaN" if math.isnan(value) else value
        raise ValueError(f"frames[{first + index}]: expected finite pixels, found {found}")
    return pixels


def _encode_torch(pixels: Tensor, rows: Tensor) -> list[bool]:
    """Fill rows int64 [B, W] from pixels [B, D] on any device; return which frames are constant."""
    dimension = pixels.shape[1]
    ones = dimension // 2
    if pixels.dtype == torch.uint64:  # the same order, without the wrap at 2^63
        pixels = pixels.view(torch.int64) ^ torch.iinfo(torch.int64).min
    elif not pixels.is_floating_point() and pixels.dtype != torch.uint8:
        pixels = pixels.long()  # torch compares and selects few other unsigned types
    place = min(dimension - ones, dimension - 1)
    threshold = pixels.kthvalue(place + 1, dim=1, keepdim=True).values
    above, equal = pixels > threshold, pixels == threshold
    missing = ones - above.sum(1, keepdim=True)
    rows[:] = bits.pack(above | (equal & (equal.cumsum(1, dtype=torch.int32) <= missing)))
    return equal.all(1).tolist()


def _encode_small(pixels: Tensor, rows: Tensor) -> list[bool]:
    """:func:`_encode_torch` on the CPU."""
    images = pixels.numpy()
    rows[:] = bits.pack(torch.from_numpy(_largest(images, images.shape[1] // 2)))
    return (images == images[:, :1]).all(1).tolist()


def _largest(values: np.ndarray, n: int) -> np.ndarray:
    """Mask [B, K] of the n largest of each row of values [B, K], equal ones in their order."""
    place = min(values.shape[1] - n, values.shape[1] - 1)
    threshold = np.partition(values, place, axis=1)[:, place, None]
    above, equal = values > threshold, values == threshold
    missing = n - above.sum(1, keepdims=True)
    return above | (equal & (equal.cumsum(1, dtype=np.int32) <= missing))


def _encode_large(pixels: Tensor, rows: Tensor) -> list[bool]:
    """:func:`_encode_torch` on the CPU, one frame after another; D > 1."""
    # To be written to, false from D on: new memory takes long to come by.
    mask = np.zeros(rows.shape[1] * bits.WORD, np.bool_)
    frames = zip(pixels.numpy(), rows.numpy(), strict=True)
    return [_select(image, row, mask) for image, row in frames]


def _select(pixels: np.ndarray, row: np.ndarray, mask: np.ndarray) -> bool:
    """Fill row int64 [W] from pixels [D] in two or three passes; return whether all are equal."""
    dimension = len(pixels)
    ones = dimension // 2
    # The ones are all pixels above `high` and some of those above `low` only, each with its place
    # in the sample, the packed pixels above it, and their number. None is beyond all.
    low: Any = None
    high: Any = None
    low_at, below, n_below = -1, np.full_like(row, -1), dimension
    if rest := dimension % bits.WORD:
        below[-1] = (1 << rest) - 1
    sample = np.sort(pixels[_places(dimension)], kind="stable")  # to 16 bits, a radix sort
    high_at, above, n_above = len(sample), np.zeros_like(row), 0
    # So few pixels of many values are sooner selected than passed once more.
    few = dimension // 32 if pixels.itemsize > 1 else 0
    at = len(sample) // 2
    value = sample[at]
    for _ in range(_PASSES):
        np.greater(pixels, value, out=mask[:dimension])
        larger = _packed(mask)
        n = int(_popcount(larger).sum(dtype=np.int64))
        if n > ones:
            low, low_at, below, n_below = value, at, larger, n
        else:
            high, high_at, above, n_above = value, at, larger, n
        one_value = high is not None and low == _before(high)
        if one_value or n_below - n_above <= few:
            break
        # By as many places as the count is off, to meet one of few levels, or beyond it by three
        # standard deviations of that many, to have one of many between the last value and this.
        off = (n - ones) * len(sample) / dimension
        at += round(off + math.copysign(1 + 3 * math.sqrt(abs(off)) if few else 0, off))
        if not low_at < at < high_at:
            at = (low_at + high_at) // 2
        value = sample[max(0, at)]
        if low is not None and value <= low:
            next_at = sample.searchsorted(low, "right")
            value = sample[next_at] if next_at < len(sample) else _after(low)
        if high is not None and value >= high:
            value = _before(high)
    band, missing = above ^ below, ones - n_above
    if one_value or missing == n_below - n_above:
        _keep_first(band, missing)
    else:
        among = np.unpackbits(band.view(np.uint8), bitorder="little").view(np.bool_)
        places = np.flatnonzero(among)
        among[places] = _largest(pixels[None, places], missing)
        band = _packed(among)
    np.bitwise_or(above, band, out=row)
    return one_value and n_below - n_above == dimension


@functools.lru_cache(maxsize=4)
def _places(dimension: int) -> np.ndarray:
    """Which pixels are the sample: one of each stretch, at random, lest they follow a pattern."""
    n = min(_SAMPLE, max(32, dimension // 16), dimension)
    return ((np.arange(n) + np.random.default_rng(0).random(n)) * dimension / n).astype(np.intp)


def _before(value: Any) -> Any:
    """The next smaller number of a numpy scalar's type; None for the smallest integer."""
    if value.dtype.kind == "f":
        return np.nextafter(value, value.dtype.type(-np.inf))
    return None if value == np.iinfo(value.dtype).min else value - 1


def _after(value: Any) -> Any:
    """The next larger number of a numpy scalar's type, which is not the largest."""
    return np.nextafter(value, value.dtype.type(np.inf)) if value.dtype.kind == "f" else value + 1


def _packed(mask: np.ndarray) -> np.ndarray:
    """Words int64 [W] of a mask [64 W]."""
    return np.packbits(mask, bitorder="little").view(np.int64)


def _popcount(words: np.ndarray) -> np.ndarray:
    return np.bitwise_count(words.view(np.uint64))


def _keep_first(words: np.ndarray, n: int) -> None:
    """Clear all but the first n ones of words int64 [W]."""
    running = _popcount(words).cumsum(dtype=np.int64)
    at = int(running.searchsorted(n, "right"))  # the word that holds the first one cleared
    if at == len(words):
        return
    surplus, word = int(running[at]) - n, int(words[at]) & 0xFFFF_FFFF_FFFF_FFFF
    for _ in range(surplus):
        word &= ~(1 << word.bit_length() - 1)
    words[at] = np.uint64(word).view(np.int64)
    words[at + 1 :] = 0
