"""Bit-sliced integers: many small counters held as planes of packed bits.

Counter j of a tensor int64 [P, W] has its bit of weight 2^p at bit j of plane p, wherever that bit
lies. One logic operation on a word therefore serves 64 counters, and counting n hypervectors takes
about 5 n of them (a carry-save adder tree; Harley and Seal, in Warren, Hacker's Delight, 5-2)
instead of 64 n additions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import backends
from hdc.parameters import not_among

_BLOCK = 4096  # words of a row that numpy adds at a time: they stay in the cache
WORD = 64
TIES = ("zero", "one")
_UNPACKED = 2**25  # bits at a time, at 8 bytes each, that a GPU adds up


def count_into(counts: Tensor, words: Tensor, rows: Sequence[int]) -> None:
    """Add the ones of some rows of words [N, W] to counters [P, W], in place.

    The counters need enough planes for the largest sum, which is not checked.
    """
    if counts.device.type != "cpu":
        _sum_into(counts, words, rows)
        return
    into, source = counts.numpy(), words.numpy()
    for start in range(0, words.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        _count_into(into[:, block], source[:, block], rows)


def count_classes(
    counts: Tensor, n: Tensor, words: Tensor, rows: Tensor
) -> tuple[Tensor, Tensor]:
    """Count hypervectors int64 [N, W] of classes `rows` int64 [N] into counters [L, P, W].

    Args:
        counts: changed in place, if it has enough planes.
        n: hypervectors counted so far in each class, int64 [L] (CPU).
        words, rows: as above.

    Returns:
        The counters, a copy with more planes if needed, and the new n.
    """
    rows = rows.cpu()
    added = torch.bincount(rows, minlength=len(n))
    n = n + added
    counts = with_room(counts, max(n.tolist(), default=0))
    order = rows.argsort(stable=True)
    kernels = backends.in_use.get()
    if kernels:
        ends = added.cumsum(0).numpy()
        kernels.count_into(counts.numpy(), words.numpy(), order.numpy(), ends)
        return counts, n
    start = 0
    for c, n_c in enumerate(added.tolist()):
        if n_c:
            count_into(counts[c], words, order[start : start + n_c].tolist())
            start += n_c
    return counts, n


def counted(words: Tensor, rows: Tensor, n_classes: int) -> tuple[Tensor, Tensor]:
    """:func:`count_classes` into counters of L classes that begin with zero."""
    none = words.new_zeros(n_classes, 1, words.shape[1])
    return count_classes(none, torch.zeros(n_classes, dtype=torch.int64), words, rows)


def with_room(counts: Tensor, n: int) -> Tensor:
    """Counters [L, P, W] with room for n hypervectors of a class: a copy only if needed."""
    n_planes = n.bit_length()
    n_classes, n_old, width = counts.shape
    if n_planes <= n_old:
        return counts
    grown = counts.new_zeros(n_classes, n_planes, width)
    grown[:, :n_old] = counts
    return grown


def _count_into(counts: Any, words: Any, rows: Sequence[int]) -> None:
    """:func:`count_into` by a carry-save adder tree that begins with the counters."""
    n_planes = len(counts)
    # waiting[p] holds at most two rows of weight 2^p; a third one turns the three into one row of
    # that weight and a carry. A carry out of the last plane is zero.
    waiting: list[list[Any]] = [[plane] if plane.any() else [] for plane in counts]
    waiting.append([])
    for i in rows:
        row = words[i]
        p = 0
        while p < n_planes:
            held = waiting[p]
            held.append(row)
            if len(held) < 3:
                break
            total, row = _full_adder(*held)
            waiting[p] = [total]
            p += 1
    nothing = np.zeros_like(counts[0])
    for p, plane in enumerate(counts):
        # At most three rows wait here: two, and a carry from the plane below.
        held = waiting[p] + [nothing] * (3 - len(waiting[p]))
        plane[:], carry = _full_adder(*held)
        waiting[p + 1].append(carry)


def _sum_into(counts: Tensor, words: Tensor, rows: Sequence[int]) -> None:
    """:func:`count_into` in few large operations, for a GPU."""
    bit = torch.arange(WORD).to(words)
    total = words.new_zeros(words.shape[1], WORD)
    for p, plane in enumerate(counts):
        total += ((plane[:, None] >> bit) & 1) << p
    step = max(1, _UNPACKED // total.numel())
    for start in range(0, len(rows), step):
        some = words[list(rows[start : start + step])]
        total += ((some[..., None] >> bit) & 1).sum(0)
    for p, plane in enumerate(counts):
        plane[:] = (((total >> p) & 1) << bit).sum(-1)


def greater(counts: Tensor, threshold: int) -> Tensor:
    """Mask [W] of the counters [P, W] above a number; all ones for a negative number.

    Adding 2^P − 1 − threshold to a counter overflows P bits if and only if it is greater, and the
    carry through a constant costs one operation per plane: OR where its bit is one, AND where not.
    """
    n_planes = len(counts)
    mask = torch.zeros_like(counts[0])
    if threshold < 0:
        return ~mask
    if threshold >> n_planes:
        return mask  # more than the planes can hold
    for p, plane in enumerate(counts):
        if threshold >> p & 1:
            mask &= plane
        else:
            mask |= plane
    return mask


def majority(counts: Tensor, n: int, ties: str = "zero") -> Tensor:
    """Bitwise majority int64 [W] of n hypervectors from their counts [P, W].

    For `ties` and errors, see :func:`hdc.bits.majority`.
    """
    if ties not in TIES:
        raise ValueError(f"ties: {not_among(ties, TIES)}")
    # For n ≥ 1 the zero counts beyond D are not among these.
    return greater(counts, (n - (ties == "one")) // 2)


def majorities(counts: Tensor, n: Tensor, ties: str = "zero") -> Tensor:
    """:func:`majority` of each class from counts int64 [L, P, W] and n int64 [L]: int64 [L, W].

    Zeros for a class without hypervectors.
    """
    found = counts.new_zeros(len(n), counts.shape[2])
    for c, of_class in enumerate(n.tolist()):
        if of_class:
            found[c] = majority(counts[c], of_class, ties)
    return found


def _full_adder(a: Any, b: Any, c: Any) -> tuple[Any, Any]:
    """Sum and carry of three bits at every position, for tensors and numpy arrays alike."""
    half = a ^ b
    carry = a & b
    carry |= half & c
    half ^= c
    return half, carry
