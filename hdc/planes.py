"""Bit-sliced integers: many small counters held as planes of packed bits.

Counter j of a tensor int64 [P, W] has its bit of weight 2^p at bit j of plane p, wherever that bit
lies. One logic operation on a word therefore serves 64 counters, and counting n hypervectors takes
about 5 n of them (a carry-save adder tree; Harley and Seal, in Warren, Hacker's Delight, 5-2)
instead of 64 n additions.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def vertical_sum(words: Tensor) -> Tensor:
    """Count the ones of each bit position: int64 [N, W] → planes [P, W], P = bit length of N."""
    if words.device.type == "cpu":
        return _vertical_sum_numpy(words)
    return vertical_sum_torch(words)


def vertical_sum_torch(words: Tensor) -> Tensor:
    """:func:`vertical_sum` in torch alone: all triples of a weight at a time, for wide devices."""
    n, width = words.shape
    result = words.new_zeros(max(1, n.bit_length()), width)
    rows = words
    for plane in result:
        carries: list[Tensor] = []
        while len(rows) > 2:
            third = len(rows) // 3
            total, carry = _full_adder(*rows[: 3 * third].view(3, third, width))
            carries.append(carry)
            rows = torch.cat((total, rows[3 * third :]))
        if len(rows) == 2:
            carries.append((rows[0] & rows[1]).unsqueeze(0))
            plane.copy_(rows[0] ^ rows[1])
        elif len(rows) == 1:
            plane.copy_(rows[0])
        rows = torch.cat(carries) if carries else rows[:0]
    return result


def _vertical_sum_numpy(words: Tensor) -> Tensor:
    """:func:`vertical_sum` a row at a time, so that the rows in hand stay in the cache."""
    n, width = words.shape
    n_planes = max(1, n.bit_length())
    # waiting[p] holds at most two rows of weight 2^p; a third one turns the three into one row of
    # that weight and a carry.
    waiting: list[list[np.ndarray]] = [[] for _ in range(n_planes + 1)]
    for row in words.numpy():
        p = 0
        while True:
            waiting[p].append(row)
            if len(waiting[p]) < 3:
                break
            total, row = _full_adder(*waiting[p])
            waiting[p] = [total]
            p += 1
    result = np.zeros((n_planes, width), np.int64)
    for p, rows in enumerate(waiting[:n_planes]):
        # What waits is at most three rows here: two, and a carry from the plane below.
        if len(rows) == 3:
            result[p], carry = _full_adder(*rows)
            waiting[p + 1].append(carry)
        elif len(rows) == 2:
            result[p] = rows[0] ^ rows[1]
            waiting[p + 1].append(rows[0] & rows[1])
        elif rows:
            result[p] = rows[0]
    return torch.from_numpy(result)


def add(a: Tensor, b: Tensor) -> Tensor:
    """Sum of two sets of counters: [P, W] + [P', W] → [P'', W], grown by a plane where needed."""
    if len(a) < len(b):
        a, b = b, a
    total = torch.empty_like(a)
    carry = torch.zeros_like(a[0])
    for p, plane in enumerate(a):
        if p < len(b):
            total[p], carry = _full_adder(plane, b[p], carry)
        else:
            total[p], carry = plane ^ carry, plane & carry
    return torch.cat((total, carry.unsqueeze(0))) if carry.any() else total


def compare(counts: Tensor, threshold: int) -> tuple[Tensor, Tensor]:
    """Where counters [P, W] are greater than, and where equal to, a number ≥ 0: two masks [W].

    A number that the planes cannot hold is greater than every counter.
    """
    more = torch.zeros_like(counts[0])
    equal = torch.full_like(more, -1)
    if threshold >> len(counts):
        return more, more.clone()
    for p in range(len(counts) - 1, -1, -1):
        if threshold >> p & 1:
            equal = equal & counts[p]
        else:
            more = more | (equal & counts[p])
            equal = equal & ~counts[p]
    return more, equal


def _full_adder(a, b, c):
    """Sum and carry of three bits at every position, for tensors and numpy arrays alike."""
    half = a ^ b
    carry = a & b
    carry |= half & c
    half ^= c
    return half, carry
