"""Exact products of matrices of bytes.

A product of int8 matrices in int32 runs on the byte instructions of a recent CPU (VNNI, AMX), some
eight times faster than the float32 product of the same size, and makes no rounding error.
"""

from __future__ import annotations

import functools

import torch
from torch import Tensor

# int32 holds a sum of this many products of two int8: 2¹⁷·(−128)² = 2³¹ would be one too many.
INT32_TERMS = 2**17 - 1


def integer_product(a: Tensor, b: Tensor) -> Tensor:
    """a·b exactly: int8 [n, k] and [k, m] → float64 [n, m].

    Off the CPU, and on one whose byte instructions are not exact, it is a product in float64.
    """
    if a.device.type != "cpu" or not native_is_exact():
        return a.double() @ b.double()
    product = torch.zeros(a.shape[0], b.shape[1], dtype=torch.float64)
    for start in range(0, a.shape[1], INT32_TERMS):
        product += _native(
            a[:, start : start + INT32_TERMS], b[start : start + INT32_TERMS]
        )
    return product


@functools.cache
def native_is_exact() -> bool:
    """Whether torch's integer product is there and right on this CPU.

    Without VNNI instructions oneDNN may add pairs of products in 16 bits, which saturate
    (pytorch issue 136746), so the largest products are tried once.
    """
    if not hasattr(torch, "_int_mm"):
        return False
    signs = torch.arange(64 * 64).reshape(64, 64) * 7919 % 13 < 6
    a = torch.where(signs, 127, -128).to(torch.int8)
    return all(
        bool((_native(x, y) == x.long() @ y.long()).all())
        for x, y in [(a, a.T), (a, a), (a[:1], a), (a[:, :1], a[:1])]
    )


def _native(a: Tensor, b: Tensor) -> Tensor:
    # A dimension of one may have any stride, and _int_mm trusts it (pytorch issue 195066).
    a, b = (x.flatten().view(x.shape) if 1 in x.shape else x for x in (a, b))
    return torch._int_mm(a, b)
