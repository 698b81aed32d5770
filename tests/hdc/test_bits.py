"""Packed bits: every route gives the same bits as unpacked ones."""

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch import Tensor

from hdc import bits, planes


@pytest.fixture(autouse=True, scope="module")
def short_blocks():
    """Rows are longer than what is counted at a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planes, "_BLOCK", 2)
        yield


def mask_of(shape, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).random(shape) < 0.5)


class Elsewhere(Tensor):
    """A tensor that says that it is on another device."""

    device = property(lambda self: torch.device("cuda"))


def elsewhere(words):
    return words.as_subclass(Elsewhere)


ROUTES = [lambda words: words, elsewhere]
if torch.cuda.is_available():
    ROUTES.append(lambda words: words.cuda())


@pytest.mark.parametrize("route", ROUTES)
def test_bit_j_lies_in_word_j_over_64_least_significant_first(route):
    for j in range(130):
        mask = torch.zeros(130, dtype=torch.bool)
        mask[j] = True
        expected = [0, 0, 0]
        expected[j // 64] = (1 << j % 64) if j % 64 < 63 else -(1 << 63)
        assert bits.pack(route(mask)).tolist() == expected


@pytest.mark.parametrize("route", ROUTES)
@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=20))
@example([-1, 0, 1, -(2**63), 2**63 - 1])
@settings(max_examples=50, deadline=None)
def test_population_counts_of_any_word(route, values):
    words = route(torch.tensor(values))
    expected = [(v & (2**64 - 1)).bit_count() for v in values]
    assert bits.count_ones(words[:, None]).tolist() == expected
    assert bits.count_ones(words).item() == sum(expected)


@pytest.mark.parametrize("route", ROUTES)
@given(st.integers(0, 40), st.integers(0, 6), st.integers(1, 300), st.integers(0, 9))
@settings(max_examples=50, deadline=None)
def test_distances_and_counts_of_any_shape(route, q, n, d, seed):
    queries, prototypes = mask_of((q, d), seed), mask_of((n, d), seed + 1)
    a, b = bits.pack(route(queries)), bits.pack(route(prototypes))
    expected = (queries[:, None] ^ prototypes).sum(-1)
    assert bits.hamming(a, b).tolist() == expected.tolist()
    assert bits.unpack(a, d).tolist() == queries.tolist()
    counts = route(torch.zeros(6, bits.words_for(d), dtype=torch.int64))
    planes.count_into(counts, a, range(q))
    planes.count_into(counts, a, range(0, q, 2))
    ones = sum(bits.unpack(plane, d).long() << p for p, plane in enumerate(counts))
    assert ones.tolist() == (queries.sum(0) + queries[::2].sum(0)).tolist()


def test_queries_in_several_steps_have_the_distances_of_one():
    """So many words that a step of numpy has some of the queries only."""
    queries, prototypes = mask_of((5, 64)), mask_of((2, 64), 1)
    expected = (queries[:, None] ^ prototypes).sum(-1).repeat_interleave(2**15, 0)
    a = bits.pack(queries).repeat_interleave(2**15, 0)
    assert torch.equal(bits.hamming(a, bits.pack(prototypes)), expected)


WORDS = torch.zeros(2, 1, dtype=torch.int64)
INT64 = "expected packed words of int64, found"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bits.pack(WORDS), r"mask: expected dtype torch\.bool, found torch\.int64"),
        (lambda: bits.unpack(WORDS, 65), "expected 2 words for D = 65, found 1"),
        (lambda: bits.hamming(WORDS, WORDS.repeat(1, 3)), "found 1 and 3 words"),
        (lambda: bits.hamming(WORDS, WORDS.double()), f"hamming: {INT64} "),
        (lambda: bits.unpack(WORDS.int(), 64), f"{INT64} int32"),
        (lambda: bits.majority(WORDS, "half"), "ties: expected one of zero, one, found"),
        (lambda: bits.majority(WORDS[:0]), "expected at least one hypervector"),
        (lambda: bits.check_padding(WORDS + 2, 1), "zeros beyond D = 1 bits, found ones"),
    ],
)  # fmt: skip
def test_wrong_types_and_widths_are_named(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call()


@pytest.mark.parametrize("p", [0, 0.001, 0.25, 0.5, 1])
def test_random_bits_are_one_with_probability_p(p):
    words = bits.random_hypervector(1_000_001, 3, p)
    share = bits.count_ones(words).item() / 1_000_001
    assert abs(share - p) <= 5 * (p * (1 - p) / 1_000_001) ** 0.5
    assert torch.equal(words, bits.random_hypervector(1_000_001, 3, p))
    fewer = bits.random_hypervector(1_000_001, 3, 0.5 * p)
    assert not (fewer & ~words).any()


@pytest.mark.parametrize("n", [1, 2, 3, 4, 80, 255, 256, 65_537])
@pytest.mark.parametrize("ties", planes.TIES)
def test_majority_is_the_count_compared_with_half(n, ties):
    d = 65 if n > 1000 else 1000
    vectors = mask_of((n, d))
    counts = vectors.sum(0)
    expected = (2 * counts > n) | ((2 * counts == n) & (ties == "one"))
    found = bits.majority(bits.pack(vectors), ties)
    assert torch.equal(bits.unpack(found, d), expected)
    bits.check_padding(found, d)  # bits beyond the last stay zero


def counters(values, n_planes):
    """Planes of given integers [D]."""
    return torch.stack([bits.pack((values >> p & 1).bool()) for p in range(n_planes)])


def numbers(most):
    return st.lists(st.integers(0, most), min_size=70, max_size=70).map(torch.tensor)


@given(numbers(1000), st.integers(0, 2000))
@settings(max_examples=60, deadline=None)
def test_comparisons_of_bit_sliced_integers(x, threshold):
    greater = planes.greater(counters(x, 10), threshold)
    assert torch.equal(bits.unpack(greater, 70), x > threshold)
