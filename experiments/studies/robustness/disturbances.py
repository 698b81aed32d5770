"""Faults after training: of the frames that a model sees, and of its stored bits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor

_BLOCK = 2**18  # bytes of a tensor whose flips are drawn at a time


def shift(
    frames: np.ndarray,
    level: int,
    random: np.random.Generator,
) -> np.ndarray:
    """The camera moved by `level` columns; what comes into sight repeats the column at the edge."""
    columns = np.arange(frames.shape[2]) - level
    return frames[:, :, np.maximum(columns, 0)]


def dither(frames: np.ndarray, level: int, random: np.random.Generator) -> np.ndarray:
    """Whole numbers uniform in −level … level, added to each pixel of frames [N, H, W]: as much as
    another conversion to grey or a lossy codec changes."""
    brightest = np.iinfo(frames.dtype).max
    added = random.integers(-level, level, frames.shape, endpoint=True)
    return np.clip(frames + added, 0, brightest).astype(frames.dtype)


OF_FRAMES: dict[str, Callable[..., np.ndarray]] = {
    "shift": shift,
    "dither": dither,
}


@contextmanager
def flipped_bits(
    tensors: Iterable[Tensor], rate: float, seed: Sequence[int]
) -> Iterator[None]:
    """Every stored bit of these tensors flipped with probability `rate`, and back at the end.

    The tensors are contiguous, on the CPU, of any type, and changed in place. The same seed flips
    the same bits, which undoes it.
    """
    memory = [given.detach().view(-1).view(torch.uint8).numpy() for given in tensors]

    def flip() -> None:
        random = np.random.default_rng(list(seed))
        for stored in memory:
            _flip(stored, rate, random)

    flip()
    try:
        yield
    finally:
        flip()


@contextmanager
def flipped_bits_of_int8(
    tensors: Iterable[Tensor], rate: float, seed: Sequence[int]
) -> Iterator[None]:
    """:func:`flipped_bits` of a model whose floating-point tensors are stored in 8 bits a number,
    as most libraries quantise for small devices.

    x = q·s with q in −127…127 and a step s = max|x| / 127 for each tensor, which no flip reaches.
    """
    stored, rounded = [], []
    for tensor in (given.detach() for given in tensors):
        if tensor.is_floating_point():
            step = tensor.abs().max() / 127
            q = torch.round(tensor / step.clamp(min=1e-30)).to(torch.int8)
            rounded.append((tensor, tensor.clone(), q, step))
            stored.append(q)
        else:
            stored.append(tensor)
    with flipped_bits(stored, rate, seed):
        for tensor, _, q, step in rounded:
            tensor.copy_(q * step)
        try:
            yield
        finally:
            for tensor, exact, *_ in rounded:
                tensor.copy_(exact)


def _flip(stored: np.ndarray, rate: float, random: np.random.Generator) -> None:
    """Flip bits of bytes uint8 [n] in place, block by block."""
    for start in range(0, len(stored), _BLOCK):
        block = stored[start : start + _BLOCK]
        flips = np.zeros(8 * len(block), np.bool_)
        count = random.binomial(len(flips), rate)
        chosen = random.choice(len(flips), count, replace=False, shuffle=False)
        flips[chosen] = True
        block ^= np.packbits(flips)
