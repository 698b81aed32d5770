"""Frames to hypervectors: threshold each frame at its own median, with exactly half ones.

The paper thresholds a speckle pattern so that 0 and 1 appear with the same probability. Thousands
of the 250,000 pixels of an 8-bit frame equal the median, so a plain comparison leaves 49.4 % ones;
here exactly k = ⌊D/2⌋ pixels become one: those above the k-th largest value m, and of those equal
to m the first in raster order. The order has to be the same for every frame and nothing else: a
Hamming distance does not know where in the image a pixel lies.

On the CPU, of large frames of integers only a sample is sorted. Its order says about where m lies
(Floyd and Rivest, Commun. ACM 18, 165 (1975)); one pass over the frame counts the pixels above a
value and so says on which side. Two or three passes leave the pixels of one grey level of 8 bits.
The counts of all pixels decide, so the sample changes no bit.
"""

from __future__ import annotations

import functools
import math
import warnings

import numpy as np
import torch
from torch import Tensor

from hdc import bits

_STEP = 2**20  # pixels of several frames thresholded at once, at up to 30 bytes each
_SMALL = (
    4096  # pixels per frame up to which that is faster than one frame after another
)
_SAMPLE = 4096  # pixels of a frame that are sorted, at most


def encode(
    frames: Tensor, first: int = 0, backend: str = "numpy", out: Tensor | None = None
) -> Tensor:
    """Hypervectors of frames: [N, H, W] or [N, D] of any real or integer dtype → int64 [N, ⌈D/64⌉].

    Each hypervector has exactly ⌊D/2⌋ ones. A constant frame carries no information; it gets its
    ones by the order of pixels alone, and a warning names it. Besides the result, memory is needed
    for one frame (or 2^20 pixels), however many there are.

    Args:
        frames: on any device.
        first: number of the first frame, in warnings and errors.
        backend: ``"compiled"`` encodes 8-bit frames on the CPU by :mod:`hdc.compiled`.
        out: words with as many rows at least, to be overwritten and returned; allocating is slow.

    Raises:
        ValueError: for another shape, no pixels, pixels that are not finite, or a backend that is
            not to be had (:func:`hdc.bits.kernels`).
        TypeError: for a dtype that has no order (bool, complex).
    """
    kernels = bits.kernels(backend, frames.device)
    if frames.ndim not in (2, 3) or 0 in frames.shape[1:]:
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D] with pixels, found {tuple(frames.shape)}"
        )
    if frames.dtype == torch.bool or frames.is_complex():
        raise TypeError(
            f"frames: expected real or integer pixels, found {frames.dtype}"
        )
    n, dimension = len(frames), frames.shape[1:].numel()
    width = bits.words_for(dimension)
    if out is None:
        out = torch.empty(n, width, dtype=torch.int64, device=frames.device)
    words = out[:n]
    constant: list[int] = []
    if kernels and frames.dtype == torch.uint8 and dimension > 1:
        constant = kernels.encode_uint8(
            frames.reshape(n, dimension).numpy(), words.numpy()
        )
    else:
        step = max(1, _STEP // dimension)
        route = _encode_torch
        if frames.device.type == "cpu":
            large = dimension > _SMALL and not frames.is_floating_point()
            route = _encode_large if large else _encode_small
        for start in range(0, n, step):
            block = slice(start, start + step)
            flat = route(_pixels(frames[block], first + start), words[block])
            constant += [start + i for i, is_flat in enumerate(flat) if is_flat]
    warn_of_constant(constant, first)
    return words


def warn_of_constant(constant: list[int], first: int) -> None:
    """Warn of frames, counted from number `first`, of which all pixels are equal; if there are."""
    if constant:
        listed = ", ".join(
            [*(str(first + i) for i in constant[:10]), "…"][: len(constant)]
        )
        reason = "every pixel is equal, so the hypervector carries no information"
        warnings.warn(
            f"{len(constant)} constant frame(s), at index {listed}: {reason}",
            stacklevel=3,
        )


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
        raise ValueError(
            f"frames[{first + index}]: expected finite pixels, found {found}"
        )
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
    rows[:] = bits.pack(
        above | (equal & (equal.cumsum(1, dtype=torch.int32) <= missing))
    )
    return equal.all(1).tolist()


def _encode_small(pixels: Tensor, rows: Tensor) -> list[bool]:
    """:func:`_encode_torch` on the CPU."""
    images = pixels.numpy()
    dimension = images.shape[1]
    ones = dimension // 2
    place = min(dimension - ones, dimension - 1)
    threshold = np.partition(images, place, axis=1)[:, place, None]
    above, equal = images > threshold, images == threshold
    missing = ones - above.sum(1, keepdims=True)
    mask = above | (equal & (equal.cumsum(1, dtype=np.int32) <= missing))
    rows[:] = bits.pack(torch.from_numpy(mask))
    return equal.all(1).tolist()


def _encode_large(pixels: Tensor, rows: Tensor) -> list[bool]:
    """:func:`_encode_torch` of integers on the CPU, one frame after another; D > 1."""
    mask = np.zeros(rows.shape[1] * bits.WORD, np.bool_)
    frames = zip(pixels.numpy(), rows.numpy(), strict=True)
    return [_select(image, row, mask) for image, row in frames]


def _select(pixels: np.ndarray, row: np.ndarray, mask: np.ndarray) -> bool:
    """Fill row int64 [W] from integers [D] in two or three passes; return whether all are equal."""
    dimension = len(pixels)
    ones = dimension // 2
    # More than D/2 pixels are above `low`, as `below` says; the others not, as `above` says.
    low, high = np.iinfo(pixels.dtype).min - 1, int(np.iinfo(pixels.dtype).max)
    below, n_below = np.full_like(row, -1), dimension
    if rest := dimension % bits.WORD:
        below[-1] = (1 << rest) - 1
    above, n_above = np.zeros_like(row), 0
    sample = np.sort(
        pixels[_places(dimension)], kind="stable"
    )  # to 16 bits, a radix sort
    at = len(sample) // 2
    while high - low > 1:
        value = int(sample[min(max(0, at), len(sample) - 1)])
        if not low < value < high:
            nearest = low + 1 if value <= low else high - 1
            value = nearest if pixels.itemsize == 1 else (low + high) // 2
        np.greater(pixels, value, out=mask[:dimension])
        larger = np.packbits(mask, bitorder="little").view(np.int64)
        n = int(_popcount(larger).sum(dtype=np.int64))
        if n > ones:
            low, below, n_below = value, larger, n
        else:
            high, above, n_above = value, larger, n
        off = (n - ones) * len(sample) / dimension
        at += round(off + math.copysign(1, off))
    band = above ^ below
    _keep_first(band, ones - n_above)
    np.bitwise_or(above, band, out=row)
    return n_below - n_above == dimension


@functools.lru_cache(maxsize=4)
def _places(dimension: int) -> np.ndarray:
    """Which pixels are the sample: one of each stretch, at random, lest they follow a pattern."""
    n = min(_SAMPLE, max(32, dimension // 16), dimension)
    return ((np.arange(n) + np.random.default_rng(0).random(n)) * dimension / n).astype(
        np.intp
    )


def _popcount(words: np.ndarray) -> np.ndarray:
    return np.bitwise_count(words.view(np.uint64))


def _keep_first(words: np.ndarray, n: int) -> None:
    """Clear all but the first n ones of words int64 [W]."""
    running = _popcount(words).cumsum(dtype=np.int64)
    at = int(
        running.searchsorted(n, "right")
    )  # the word that holds the first one cleared
    if at == len(words):
        return
    surplus, word = int(running[at]) - n, int(words[at]) & 0xFFFF_FFFF_FFFF_FFFF
    for _ in range(surplus):
        word &= ~(1 << word.bit_length() - 1)
    words[at] = np.uint64(word).view(np.int64)
    words[at + 1 :] = 0
