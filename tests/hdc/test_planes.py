"""Bit-sliced integers against plain integers."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from hdc import bits, planes


def counters(values: Tensor, n_planes: int) -> Tensor:
    """Planes of given integers [D]."""
    return torch.stack([bits.pack((values >> p & 1).bool()) for p in range(n_planes)])


def integers(rows: Tensor, d: int) -> Tensor:
    return sum(
        (bits.unpack(row, d).long() << p for p, row in enumerate(rows)), torch.zeros(())
    )


def test_rows_longer_than_a_block_are_counted_once(monkeypatch):
    monkeypatch.setattr(planes, "_BLOCK", 2)
    words = bits.pack(torch.from_numpy(np.random.default_rng(0).random((9, 500)) < 0.5))
    counts = torch.zeros(4, words.shape[1], dtype=torch.int64)
    planes.count_into(counts, words, [0, 3, 3, 5, 8])
    expected = bits.unpack(words, 500).long()[[0, 3, 3, 5, 8]].sum(0)
    assert torch.equal(integers(counts, 500).long(), expected)


@given(
    st.lists(st.integers(0, 40), min_size=70, max_size=70),
    st.lists(st.integers(0, 69), max_size=60),
)
@settings(max_examples=60, deadline=None)
def test_counting_into_what_was_counted_before(start, rows):
    mask = torch.from_numpy(np.random.default_rng(3).random((70, 70)) < 0.5)
    before = torch.tensor(start)
    counts = counters(before, 7)
    planes.count_into(counts, bits.pack(mask), rows)
    assert torch.equal(integers(counts, 70).long(), before + mask[rows].sum(0))


numbers = st.lists(st.integers(0, 1000), min_size=70, max_size=70)


@given(numbers, numbers, st.integers(10, 13), st.integers(0, 2000))
@settings(max_examples=60, deadline=None)
def test_sums_and_comparisons(a, b, extra, threshold):
    x, y = torch.tensor(a), torch.tensor(b)
    total = planes.add(counters(x, 10), counters(y, extra))
    assert torch.equal(integers(total, 70).long(), x + y)
    assert torch.equal(planes.add(counters(y, extra), counters(x, 10)), total)
    greater = planes.greater(counters(x, 10), threshold)
    assert torch.equal(bits.unpack(greater, 70), x > threshold)
