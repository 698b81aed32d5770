"""Linear functions of packed bits, with weights of 8 bits each."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.bits import dot
from hdc.hypervectors import Hypervectors
from hdc.readouts.base import State
from hdc.tensors import Kinds

_OFFSET, _PLANES = 128, 8  # weights are stored as q + 128, bit-sliced
_STEP = 32  # words unpacked at a time; for some hundred frames they stay in the cache


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear(State):
    """L linear functions of packed bits, with weights scale·q_j of 8 bits each."""

    kinds: ClassVar[Kinds] = {
        "weights": "int64 L 8 W",
        "scales": "float64 L",
        "intercepts": "float64 L",
        "penalty": "float64",
    }
    weights: Tensor
    """int64 [L, 8, W], bit-sliced q + 128."""
    scales: Tensor
    """float64 [L] (CPU)."""
    intercepts: Tensor
    """float64 [L] (CPU)."""
    penalty: Tensor
    """float64 [], λ."""

    def values(self, words: Hypervectors) -> Tensor:
        """w·x + b of Q hypervectors, float64 [Q, L]; the products are exact."""
        n = torch.full((len(self.weights),), 2 * _OFFSET)
        twice = dot(self.weights, n, words.packed, words.dimension)
        scales = self.scales.to(twice.device)
        return twice // 2 * scales + self.intercepts.to(twice.device)

    def floats(self, start: int, stop: int) -> Tensor:
        """Weights float64 [L, B] of the bits in words start to stop."""
        n_bits = (stop - start) * bits.WORD
        sliced = bits.unpack(self.weights[..., start:stop], n_bits).double().cpu()
        powers = 2.0 ** torch.arange(_PLANES, dtype=torch.float64)
        shifted = torch.einsum("p,tpb->tb", powers, sliced)
        return (shifted - _OFFSET) * self.scales[:, None]


def quantised(
    words: Tensor,
    weights_in: Callable[[int, int], Tensor],
    dimension: int,
    prior: Linear | None,
) -> tuple[Tensor, Tensor]:
    """Round weights to 8 bits: planes int64 [T, 8, W] and scales float64 [T].

    Args:
        words: hypervectors int64 [N, W].
        weights_in: function of start and stop that gives the weights float64 [T, B] of the bits in
            these words; it is called twice for a few words at a time.
        dimension: D.
        prior: function whose weights are added.
    """
    width = words.shape[1]
    starts = range(0, width, _STEP)

    def weights(start: int) -> Tensor:
        stop = min(start + _STEP, width)
        total = weights_in(start, stop)
        if prior is not None:
            total = total + prior.floats(start, stop)
        return total

    largest_each = [weights(start).abs().amax(1) for start in starts]
    largest = torch.stack(largest_each).amax(0)
    scales = torch.where(largest > 0, largest / (_OFFSET - 1), 1.0)
    planes = words.new_zeros(len(scales), _PLANES, width)
    for start in starts:
        stop = min(start + _STEP, width)
        q = (weights(start) / scales[:, None]).round()
        shifted = q.long() + _OFFSET
        n_inside = max(0, dimension - start * bits.WORD)
        shifted[:, n_inside:] = 0
        for p in range(_PLANES):
            packed = bits.pack((shifted >> p) & 1 == 1)
            planes[:, p, start:stop] = packed.to(words.device)
    return planes, scales


def weights_of(dual: Tensor, words: Tensor, start: int, stop: int) -> Tensor:
    """Weights Xᵀa of the bits in words start to stop, float64 [T, B]."""
    part = words[:, start:stop].cpu().contiguous().numpy()
    signs = _signs_of_bytes()[part.view(np.uint8)]
    return dual.T @ torch.from_numpy(signs).flatten(1)


@functools.cache
def _signs_of_bytes() -> np.ndarray:
    """The bits of each byte in ±1, the lowest first: float64 [256, 8]."""
    bytes_ = np.arange(256, dtype=np.uint8)[:, None]
    ones = np.unpackbits(bytes_, axis=1, bitorder="little")
    return 2.0 * ones - 1.0
