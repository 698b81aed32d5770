"""Exact products of frames: of their pixels with each other, and of matrices of bytes.

A product of int8 matrices in int32 runs on the byte instructions of a recent CPU (VNNI, AMX), some
eight times faster than the float32 product of the same size, and makes no rounding error. Without
these instructions it may be slow or wrong; then float32 products of few enough terms, which are
exact, too, take its place. Pixels become signed bytes by subtracting :func:`constant_of` their
type; pixels of 16 bits are two bytes.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

# int32 holds a sum of this many products of two int8: 2¹⁷·(−128)² = 2³¹ would be one too many.
INT32_TERMS = 2**17 - 1
FLOAT32_TERMS = 2**10
"""float32 holds every whole number up to 2²⁴ = 2¹⁰·(−128)²."""
_PIXELS = 32768  # columns of the frames handled at a time
_FRAMES = 20  # rows squared at a time


class Moments(NamedTuple):
    """Σ x and Σ x² over the pixels of each frame, float64 [N] each."""

    first: Tensor
    second: Tensor

    def of(self, rows: object) -> Moments:
        """Moments of some of the frames."""
        return Moments(self.first[rows], self.second[rows])  # type: ignore[index]


def moments(images: Tensor) -> Moments:
    """Exact moments of frames [N, D], less :func:`constant_of` their type."""
    constant = constant_of(images)
    first, second = [], []
    for rows in images.split(_FRAMES):
        block = rows.int() - constant
        first.append(block.sum(dim=1))
        second.append(block.square_().sum(dim=1))
    return Moments(torch.cat(first).double(), torch.cat(second).double())


def cross_products(a: Tensor, b: Tensor) -> Tensor:
    """Exact Σ x·x′ over the pixels of frames [n, D] and [m, D], float64 [n, m].

    Pixels are uint8, uint16 or int32 (for 16 bits), minus :func:`constant_of` their type.
    """
    products = torch.zeros(len(a), len(b), dtype=torch.float64, device=a.device)
    for start in range(0, a.shape[1], _PIXELS):
        columns = slice(start, start + _PIXELS)
        rights = _planes(b[:, columns])
        for weight, left in _planes(a[:, columns]):
            for other, right in rights:
                products += weight * other * integer_product(left, right.T)
    return products


def constant_of(images: Tensor) -> int:
    """The grey value subtracted so that a byte is signed."""
    if images.dtype == torch.uint8:
        return 128
    return 256 * 128 + 128


def _planes(block: Tensor) -> list[tuple[int, Tensor]]:
    """Pixels minus their constant as Σ weight·plane, each plane int8."""
    if block.dtype == torch.uint8:
        return [(1, _signed(block))]
    block = block.int()
    high = (block >> 8).to(torch.uint8)
    low = (block & 255).to(torch.uint8)
    return [(256, _signed(high)), (1, _signed(low))]


def _signed(block: Tensor) -> Tensor:
    """Bytes 0…255 → −128…127."""
    return (block ^ 128).view(torch.int8)


def integer_product(a: Tensor, b: Tensor) -> Tensor:
    """a·b exactly: int8 [n, k] and [k, m] → float64 [n, m].

    Off the CPU it is a product in float64.
    """
    if a.device.type != "cpu":
        return a.double() @ b.double()
    if native_is_exact() and native_is_fast():
        return _in_parts(_native, a, b, INT32_TERMS)
    return _in_parts(_by_floats, a, b, FLOAT32_TERMS)


def _in_parts(
    product: Callable[[Tensor, Tensor], Tensor], a: Tensor, b: Tensor, n_terms: int
) -> Tensor:
    """A product that is exact for so many terms, float64 [n, m]."""
    total = torch.zeros(a.shape[0], b.shape[1], dtype=torch.float64)
    for start in range(0, a.shape[1], n_terms):
        terms = slice(start, start + n_terms)
        total += product(a[:, terms], b[terms])
    return total


def _by_floats(a: Tensor, b: Tensor) -> Tensor:
    return a.float() @ b.float()


@functools.cache
def native_is_fast() -> bool:
    """Whether torch's integer product is faster here than its float32 product; tried once."""
    a = torch.zeros(128, FLOAT32_TERMS, dtype=torch.int8)
    native = min(_seconds(_native, a) for _ in range(3))
    floats = min(_seconds(_by_floats, a) for _ in range(3))
    return native < floats


def _seconds(product: Callable[[Tensor, Tensor], Tensor], a: Tensor) -> float:
    start = time.perf_counter()
    product(a, a.T)
    return time.perf_counter() - start


@functools.cache
def native_is_exact() -> bool:
    """Whether torch has an integer product that is right on this CPU.

    Without VNNI instructions oneDNN may add pairs of products in 16 bits, which saturate
    (pytorch issue 136746), so the largest products are tried once.
    """
    if not hasattr(torch, "_int_mm"):
        return False
    mixed = torch.arange(64 * 64).reshape(64, 64) * 7919 % 13
    a = torch.where(mixed < 6, 127, -128).to(torch.int8)
    pairs = [(a, a.T), (a, a), (a[:1], a), (a[:, :1], a[:1])]
    for left, right in pairs:
        exact = left.long() @ right.long()
        if not torch.equal(_native(left, right).long(), exact):
            return False
    return True


def _native(a: Tensor, b: Tensor) -> Tensor:
    return torch._int_mm(_plainly_laid_out(a), _plainly_laid_out(b))


def _plainly_laid_out(x: Tensor) -> Tensor:
    """A dimension of one may have any stride, and _int_mm trusts it (pytorch issue 195066)."""
    return x.flatten().view(x.shape) if 1 in x.shape else x
