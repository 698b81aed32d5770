"""Linear functions of packed bits, with weights of 8 bits each."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.bits import shifted_dot
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
        products = shifted_dot(self.weights, _OFFSET, words.packed, words.dimension)
        scales = self.scales.to(products.device)
        return products * scales + self.intercepts.to(products.device)

    def floats(self) -> Tensor:
        """The weights, float64 [L, 64·W] (CPU)."""
        n_bits = self.weights.shape[2] * bits.WORD
        shifted = bits.numbers_of(self.weights.cpu(), n_bits)
        return (shifted - _OFFSET).double() * self.scales[:, None]


def quantised(weights: Tensor, dimension: int) -> tuple[Tensor, Tensor]:
    """Weights float64 [T, 64·W] rounded to 8 bits: planes int64 [T, 8, W], scales float64 [T]."""
    largest = weights.abs().amax(1)
    scales = torch.where(largest > 0, largest / (_OFFSET - 1), 1.0)
    q = (weights / scales[:, None]).round()
    shifted = (q + _OFFSET).to(torch.uint8)
    shifted[:, dimension:] = 0
    return bits.sliced(shifted, _PLANES), scales


def weights_of(dual: Tensor, words: Tensor) -> Tensor:
    """Weights Xᵀa of the bits of hypervectors int64 [N, W], a [N, T]: float64 [T, 64·W]."""
    parts = []
    for columns in words.cpu().split(_STEP, 1):
        of_bytes = columns.contiguous().numpy().view(np.uint8)
        signs = torch.from_numpy(_signs_of_bytes()[of_bytes]).flatten(1)
        parts.append(dual.T @ signs)
    return torch.cat(parts, 1)


@functools.cache
def _signs_of_bytes() -> np.ndarray:
    """The bits of each byte in ±1, the lowest first: float64 [256, 8]."""
    bytes_ = np.arange(256, dtype=np.uint8)[:, None]
    ones = np.unpackbits(bytes_, axis=1, bitorder="little")
    return 2.0 * ones - 1.0
