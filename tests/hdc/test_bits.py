"""Packed bits: every route gives the same bits as unpacked ones."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch import Tensor

from hdc import bits, planes


def mask_of(shape: tuple[int, ...], seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random(shape) < 0.5)


def test_bit_j_lies_in_word_j_over_64_least_significant_first():
    for j in range(130):
        mask = torch.zeros(130, dtype=torch.bool)
        mask[j] = True
        words = bits.pack(mask).tolist()
        expected = [0, 0, 0]
        expected[j // 64] = (1 << j % 64) if j % 64 < 63 else -(1 << 63)
        assert words == expected


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=20))
@example([-1, 0, 1, -(2**63), 2**63 - 1])
@settings(max_examples=100, deadline=None)
def test_population_counts_of_any_word(values):
    words = torch.tensor(values)
    expected = [(v & (2**64 - 1)).bit_count() for v in values]
    assert bits.popcount(words).tolist() == expected
    assert bits.count_ones(words).item() == sum(expected)


@given(st.integers(0, 40), st.integers(0, 6), st.integers(1, 300), st.integers(0, 9))
@settings(max_examples=60, deadline=None)
def test_hamming_of_any_shape(q, n, d, seed):
    queries, prototypes = mask_of((q, d), seed), mask_of((n, d), seed + 1)
    expected = (queries[:, None] ^ prototypes).sum(-1)
    a, b = bits.pack(queries), bits.pack(prototypes)
    assert torch.equal(bits.hamming(a, b), expected)
    assert torch.equal(bits.unpack(a, d), queries)


class Elsewhere(Tensor):
    """A tensor that says that it is on another device."""

    device = property(lambda self: torch.device("cuda"))


@given(st.integers(1, 40), st.integers(1, 6), st.integers(1, 300), st.integers(0, 9))
@settings(max_examples=60, deadline=None)
def test_same_bits_on_other_devices(q, n, d, seed):
    queries, prototypes = mask_of((q, d), seed), mask_of((n, d), seed + 1)
    there = [bits.pack(mask.as_subclass(Elsewhere)) for mask in (queries, prototypes)]
    here = [bits.pack(mask) for mask in (queries, prototypes)]
    assert all(torch.equal(a, b) for a, b in zip(there, here, strict=True))
    assert torch.equal(bits.unpack(there[0], d), queries)
    assert torch.equal(bits.popcount(there[0]), bits.popcount(here[0]))
    assert torch.equal(bits.count_ones(there[0]), queries.sum(-1))
    assert torch.equal(bits.hamming(*there), bits.hamming(*here))
    counts = torch.zeros(6, bits.words_for(d), dtype=torch.int64).as_subclass(Elsewhere)
    planes.count_into(counts, there[0], range(q))
    ones = sum(bits.unpack(plane, d).long() << p for p, plane in enumerate(counts))
    assert torch.equal(torch.as_tensor(ones), queries.sum(0))


def test_wrong_types_and_widths_are_named():
    with pytest.raises(
        TypeError, match=r"mask: expected dtype torch\.bool, found torch\.uint8"
    ):
        bits.pack(torch.zeros(3, dtype=torch.uint8))
    with pytest.raises(ValueError, match="expected 2 words for D = 65, found 1"):
        bits.unpack(torch.zeros(3, 1, dtype=torch.int64), 65)
    with pytest.raises(ValueError, match="found 2 and 3 words"):
        bits.hamming(torch.zeros(1, 2).long(), torch.zeros(1, 3).long())
    with pytest.raises(TypeError, match="hamming: expected packed words of int64"):
        bits.hamming(torch.zeros(2, 3).long(), torch.zeros(2, 3).double())
    others = (bits.popcount, bits.count_ones, bits.majority)
    for call in (*others, lambda words: bits.unpack(words, 3 * bits.WORD)):
        with pytest.raises(
            TypeError, match="expected packed words of int64, found int32"
        ):
            call(torch.full((2, 3), -1, dtype=torch.int32))
    words = torch.zeros(2, 1).long()
    with pytest.raises(
        ValueError, match="ties: expected one of zero, one, random, found 'half'"
    ):
        bits.majority(words, "half")
    with pytest.raises(ValueError, match="expected a tie_breaker"):
        bits.majority(words, "random")
    with pytest.raises(ValueError, match="expected at least one hypervector"):
        bits.majority(words[:0])


@pytest.mark.parametrize("d", [1, 63, 65, 127])
def test_bits_beyond_the_last_stay_zero(d):
    ones = bits.pack(torch.ones(4, d, dtype=torch.bool))
    breaker = bits.random_hypervector(d, 1)
    for words in (ones, torch.zeros_like(ones)):
        for ties in planes.TIES:
            for n in (1, 2, 3, 4):
                bundle = bits.majority(words[:n], ties, breaker)
                assert not (bundle & ~ones[0]).any()


@pytest.mark.parametrize("p", [0, 0.001, 0.25, 0.5, 1])
def test_random_bits_are_one_with_probability_p(p):
    words = bits.random_hypervector(1_000_001, 3, p)
    share = bits.count_ones(words).item() / 1_000_001
    assert abs(share - p) <= 5 * (p * (1 - p) / 1_000_001) ** 0.5
    assert torch.equal(words, bits.random_hypervector(1_000_001, 3, p))
    fewer = bits.random_hypervector(1_000_001, 3, 0.5 * p)
    assert not (fewer & ~words).any()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_same_bits_on_cuda():
    mask = mask_of((70, 1000))
    words = bits.pack(mask)
    there = bits.pack(mask.cuda())
    assert torch.equal(there.cpu(), words)
    assert torch.equal(bits.unpack(there, 1000).cpu(), mask)
    assert torch.equal(bits.popcount(there).cpu(), bits.popcount(words))
    assert torch.equal(
        bits.hamming(there, there[:5]).cpu(), bits.hamming(words, words[:5])
    )
    assert torch.equal(bits.majority(there).cpu(), bits.majority(words))


@pytest.mark.parametrize("n", [1, 2, 3, 80, 255, 256, 65_537])
@pytest.mark.parametrize("ties", planes.TIES)
def test_majority_is_the_count_compared_with_half(n, ties):
    d = 65 if n > 1000 else 1000
    vectors, breaker = mask_of((n, d)), mask_of((1, d), 9)[0]
    counts = vectors.sum(0)
    tied = {"zero": torch.zeros(d), "one": torch.ones(d), "random": breaker}[
        ties
    ].bool()
    expected = (2 * counts > n) | ((2 * counts == n) & tied)
    words = bits.pack(vectors)
    assert torch.equal(
        bits.unpack(bits.majority(words, ties, bits.pack(breaker)), d), expected
    )
