"""Frames to hypervectors: threshold each frame at its own median, with exactly half ones.

The paper thresholds a speckle pattern so that 0 and 1 appear with the same probability. Thousands
of the 250,000 pixels of an 8-bit frame equal the median, so a plain comparison leaves 49.4 % ones;
here exactly k = ⌊D/2⌋ pixels become one: those above the k-th largest value m, and of those equal
to m the first in raster order. The order has to be the same for every frame and nothing else: a
Hamming distance does not know where in the image a pixel lies.
"""

from __future__ import annotations

import warnings

import numpy as np
import torch
from torch import Tensor

from hdc import bits, planes

_STEP = 64  # frames thresholded at once where frames of other types, or an accelerator, need it
_SCAN = 2**16  # pixels looked through at a time for ties; a multiple of 64


def encode(frames: Tensor, first: int = 0, backend: str = "numpy") -> Tensor:
    """Hypervectors of frames: [N, H, W] or [N, D] of any real or integer dtype → int64 [N, ⌈D/64⌉].

    Each hypervector has exactly ⌊D/2⌋ ones. A constant frame carries no information; it gets its
    ones by the order of pixels alone, and a warning names it. Warnings and errors count frames from
    `first`, for frames that are a part of more. ``backend="compiled"`` encodes 8-bit frames on the
    CPU by :mod:`hdc.compiled`, with the same result; other types take the same way as without.

    Raises:
        ValueError: for a shape other than the above, no pixels, pixels that are not finite, or a
            backend that is not to be had (:func:`hdc.bits.kernels`).
        TypeError: for a dtype that has no order (bool, complex).
    """
    kernels = bits.kernels(backend, frames.device)
    pixels = _flatten(frames, first)
    n, dimension = pixels.shape
    words = planes.zeros((n, bits.words_for(dimension)), pixels.device)
    constant: list[int] = []
    if dimension < 2:
        constant = list(range(n))  # ⌊D/2⌋ = 0 ones
    elif pixels.dtype == torch.uint8 and pixels.device.type == "cpu":
        encode_uint8 = kernels.encode_uint8 if kernels else _encode_uint8
        constant = encode_uint8(pixels.numpy(), words.numpy())
    else:
        for start in range(0, n, _STEP):
            words[start : start + _STEP], flat = _encode_any(pixels[start : start + _STEP])
            constant += (start + flat.nonzero().flatten()).tolist()
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


def _flatten(frames: Tensor, first: int) -> Tensor:
    if frames.ndim not in (2, 3) or 0 in frames.shape[1:]:
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D] with pixels, found {tuple(frames.shape)}"
        )
    if frames.dtype == torch.bool or frames.is_complex():
        raise TypeError(f"frames: expected real or integer pixels, found {frames.dtype}")
    pixels = frames.reshape(len(frames), frames.shape[1:].numel())
    if pixels.is_floating_point():
        bad = ~pixels.isfinite().all(1)
        if bad.any():
            index = int(bad.nonzero()[0])
            value = pixels[index][~pixels[index].isfinite()][0].item()
            raise ValueError(f"frames[{first + index}]: expected finite pixels, found {value}")
        # Exact; the half types lack a selection on some devices.
        return pixels.float() if pixels.dtype in (torch.float16, torch.bfloat16) else pixels
    if pixels.dtype == torch.uint64:  # the same order, without the wrap at 2^63
        return pixels.view(torch.int64) ^ torch.iinfo(torch.int64).min
    # Torch compares and selects few unsigned types wider than 8 bits.
    return pixels if pixels.dtype == torch.uint8 else pixels.to(torch.int64)


def _encode_any(pixels: Tensor) -> tuple[Tensor, Tensor]:
    """Hypervectors of [B, D] in plain torch, and which frames are constant: bool [B]."""
    dimension = pixels.shape[1]
    ones = dimension // 2
    threshold = pixels.kthvalue(dimension - ones + 1, dim=1, keepdim=True).values
    above, equal = pixels > threshold, pixels == threshold
    missing = ones - above.sum(1, keepdim=True)
    first = equal & (equal.cumsum(1, dtype=torch.int32) <= missing)
    return bits.pack(above | first), equal.all(1)


def _encode_uint8(images: np.ndarray, words: np.ndarray) -> list[int]:
    """:func:`_encode_any` for 8-bit frames on the CPU; fills words, returns constant frames.

    Level and cut say which pixels are ones: those above the level and, up to pixel number `cut`,
    those equal to it; all pairs (level, cut) are ordered by the number of ones. Frames of a session
    have nearly the same median, so the last frame's pair is tried first: one pass over the frame.
    Then the cut moves until the number of ones is right, at the cost of the pixels it passes.
    """
    dimension = images.shape[1]
    ones = dimension // 2
    passed = np.zeros(words.shape[1] * bits.WORD, np.bool_)
    equal = np.zeros(_SCAN, np.bool_)
    constant = []
    level, cut = _sampled_level(images[0]) if len(images) else 0, 0
    for index, pixels in enumerate(images):
        row = words[index]
        missing = ones - _threshold(pixels, level, cut, passed, row)
        if abs(missing) > dimension // 32:  # some grey levels away: counting all is faster
            level, cut = _level(pixels, ones), 0
            missing = ones - _threshold(pixels, level, cut, passed, row)
        while missing:
            if missing > 0:
                if cut == dimension:
                    level, cut = level - 1, 0
                start, stop = cut, min(dimension, cut // _SCAN * _SCAN + _SCAN)
            else:
                if cut == 0:
                    level, cut = level + 1, dimension
                start, stop = (cut - 1) // _SCAN * _SCAN, cut
            n, cut = _move_cut(pixels, level, start, stop, missing, equal, row)
            missing -= n
        # Where all pixels are equal the first ⌊D/2⌋ are ones and the cut is right behind them.
        if cut == ones and pixels.min() == pixels.max():
            constant.append(index)
    return constant


def _sampled_level(pixels: np.ndarray) -> int:
    """About the median, from every so many pixels."""
    sample = pixels[:: max(1, len(pixels) // 4096)]
    return int(np.partition(sample, len(sample) // 2)[len(sample) // 2])


def _level(pixels: np.ndarray, ones: int) -> int:
    """The largest m for which at least `ones` pixels are ≥ m, from all 256 counts."""
    at_least = np.bincount(pixels, minlength=256)[::-1].cumsum()[::-1]
    return int(np.flatnonzero(at_least >= ones)[-1])


def _threshold(
    pixels: np.ndarray, level: int, cut: int, passed: np.ndarray, row: np.ndarray
) -> int:
    """Fill row int64 [W] with the bits of (level, cut); return how many are ones."""
    np.greater_equal(pixels[:cut], level, out=passed[:cut])
    np.greater(pixels[cut:], level, out=passed[cut : len(pixels)])
    row[:] = np.packbits(passed, bitorder="little").view(np.int64)
    return int(np.bitwise_count(row.view(np.uint64)).sum(dtype=np.int64))


def _move_cut(
    pixels: np.ndarray,
    level: int,
    start: int,
    stop: int,
    missing: int,
    equal: np.ndarray,
    row: np.ndarray,
) -> tuple[int, int]:
    """Move the cut within [start, stop), forwards for missing > 0, else back from stop.

    Returns how many ones the row has gained (negative: lost), and the new cut.
    """
    first_word = start // bits.WORD
    origin = first_word * bits.WORD
    n_words = bits.words_for(stop - origin)
    equal[: start - origin] = False
    np.equal(pixels[start:stop], level, out=equal[start - origin : stop - origin])
    equal[stop - origin : n_words * bits.WORD] = False
    ties = np.packbits(equal[: n_words * bits.WORD], bitorder="little").view(np.int64)
    running = np.bitwise_count(ties.view(np.uint64)).cumsum(dtype=np.int64)
    total = int(running[-1])
    target = row[first_word : first_word + n_words]
    # The first `kept` ties of the stretch are ones, the others are not.
    kept = min(total, missing) if missing > 0 else max(0, total + missing)
    if kept in (0, total):  # the cut passes the whole stretch
        target &= ~ties
        if kept:
            target |= ties
        new_cut = stop if missing > 0 else start
    else:
        word = int(running.searchsorted(kept))  # holds the last tie that is kept
        before = int(running[word - 1]) if word else 0
        low, new_cut = _lowest_ones(int(ties[word]), kept - before)
        target[:word] |= ties[:word]
        target[word] = (target[word] & ~ties[word]) | low
        target[word + 1 :] &= ~ties[word + 1 :]
        new_cut += origin + word * bits.WORD
    return (kept, new_cut) if missing > 0 else (kept - total, new_cut)


def _lowest_ones(word: int, n: int) -> tuple[np.int64, int]:
    """The n ≥ 1 lowest ones of a 64-bit word, and the place behind the last of them."""
    kept, rest = 0, word & 0xFFFF_FFFF_FFFF_FFFF
    for _ in range(n):
        lowest = rest & -rest
        kept, rest = kept | lowest, rest ^ lowest
    return np.uint64(kept).view(np.int64), kept.bit_length()
