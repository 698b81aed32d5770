"""Counters of classes, their majority, and recalibration."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from hdc import bits
from hdc.prototypes import Counters, merged, replaced_bits, tie_breaker
from hdc.readouts import Majority
from tests.hdc.own import fitted


def vectors(n: int, d: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random((n, d)) < 0.5)


@given(
    st.lists(st.integers(0, 4), min_size=1, max_size=120),
    st.randoms(use_true_random=False),
)
@settings(max_examples=40, deadline=None)
def test_any_split_order_and_merge_count_alike(labels, random):
    mask, index = vectors(len(labels), 65), torch.tensor(labels)
    words = bits.pack(mask)
    shards = [Counters(5, 65) for _ in range(3)]
    order = list(range(len(labels)))
    random.shuffle(order)
    for i in order:
        random.choice(shards).add(words[[i]], index[[i]])
    random.shuffle(shards)
    merged = shards[0]
    for other in shards[1:]:
        merged.merge(other)
    whole = Counters(5, 65)
    whole.add(words, index)
    expected = torch.stack([mask[index == c].sum(0) for c in range(5)])
    assert torch.equal(whole.counts(), expected)
    assert torch.equal(merged.counts(), expected)
    assert torch.equal(merged.n, whole.n)
    assert torch.equal(merged.planes, whole.planes)


def test_random_ties_are_an_added_hypervector_from_the_seed():
    words = bits.pack(vectors(8, 300))
    labels = torch.arange(8) % 2
    counters = Counters(2, 300)
    counters.add(words, labels)
    prototypes = counters.majority("random", seed=7)
    added = Counters(2, 300)
    added.add(words, labels)
    breakers = torch.stack([tie_breaker(300, 7, c) for c in range(2)])
    added.add(breakers, torch.arange(2))
    assert torch.equal(prototypes, added.majority())
    assert torch.equal(prototypes, counters.majority("random", seed=7))
    assert not torch.equal(prototypes, counters.majority("random", seed=8))
    counters.majority("random", seed=2**62)  # any integer is a seed
    counters.majority("random", seed=-5)


@pytest.mark.parametrize("label", [-1, 2])
def test_class_indices_outside_are_named_and_not_counted(label):
    counters = Counters(2, 64)
    with pytest.raises(
        ValueError, match=rf"expected class indices in \[0, 2\), found {label}"
    ):
        counters.add(torch.zeros(1, 1).long(), torch.tensor([label]))
    assert counters.n.tolist() == [0, 0]


def test_disagreeing_sizes_are_named():
    counters = Counters(2, 64)
    with pytest.raises(ValueError, match="labels: expected 3, one a sample, found 2"):
        counters.add(torch.zeros(3, 1).long(), torch.zeros(2).long())
    with pytest.raises(ValueError, match="expected 1 words for D = 64, found 2"):
        counters.add(torch.zeros(3, 2).long(), torch.zeros(3).long())
    with pytest.raises(
        ValueError, match="expected 2 classes of D = 64, found 2 of D = 65"
    ):
        counters.merge(Counters(2, 65))


def replaced(n_classes: int, d: int, p: float, seed: int) -> torch.Tensor:
    return bits.unpack(replaced_bits(n_classes, d, p, seed), d)


@pytest.mark.parametrize("p", [0.0, 0.1, 0.5, 1.0])
def test_replaced_bits_are_drawn_class_by_class_with_their_probability(p):
    drawn = replaced(3, 10_001, p, 2)
    spread = (p * (1 - p) / 10_001) ** 0.5
    assert ((drawn.double().mean(1) - p).abs() <= 5 * spread).all()
    assert torch.equal(drawn, replaced(3, 10_001, p, 2))
    if 0 < p < 1:
        assert not torch.equal(drawn, replaced(3, 10_001, p, 3))
        both = (
            (drawn[0] & drawn[1]).double().mean()
        )  # the classes are drawn independently
        assert abs(float(both) - p * p) < 0.02
    assert torch.equal(replaced(2, 10_001, p, 2), drawn[:2])


def test_recalibrated_bits_come_from_either_side():
    """What :meth:`hdc.readouts.Majority.adapt` makes of old and new prototypes."""
    rows = torch.arange(6) % 3
    old, new = bits.pack(vectors(6, 10_001)), bits.pack(vectors(6, 10_001, 1))
    model = fitted(Majority(), old, rows, 3, 10_001)
    stored = model.prototypes_.clone()
    fresh = fitted(Majority(), new, rows, 3, 10_001).prototypes_
    model = model.adapted(new, rows, 0.5, 2, "replace")
    mixed = model.prototypes_
    assert not ((mixed ^ stored) & (mixed ^ fresh)).any()
    changed = (
        bits.hamming(stored, mixed).diagonal() / bits.hamming(stored, fresh).diagonal()
    )
    assert ((changed - 0.5).abs() < 0.05).all()
    again = fitted(Majority(), old, rows, 3, 10_001)
    again = again.adapted(new, rows, 0.5, 3, "replace")
    assert not torch.equal(again.prototypes_, mixed)
    again = fitted(Majority(), old, rows, 3, 10_001)
    again = again.adapted(new, rows, 1, 3, "replace")
    assert torch.equal(again.prototypes_, fresh)


@pytest.mark.parametrize("p", [-0.1, 1.1, float("nan")])
def test_probabilities_outside_are_named(p):
    message = r"p: expected a share in \[0, 1\], found"
    with pytest.raises(ValueError, match=message):
        replaced_bits(2, 64, p, 0)
    with pytest.raises(ValueError, match=message):
        merged(Counters(2, 64), Counters(2, 64), p)


def test_a_class_without_samples_has_zeros():
    counters = Counters(3, 64)
    counters.add(bits.pack(vectors(2, 64)), torch.tensor([0, 2]))
    assert counters.majority().any(1).tolist() == [True, False, True]


@pytest.mark.parametrize("ties", ["zero", "one", "random"])
def test_prototypes_of_a_size_are_those_of_thinned_counters(ties):
    counters = Counters(3, 200)
    labels = torch.tensor([0] * 9 + [1] * 4 + [2] * 3)
    counters.add(bits.pack(vectors(16, 200)), labels)
    made = counters.majority(ties, 5, 4)
    assert (made == counters.thinned(4, 5).majority(ties, 5)).all()
    assert (made[0] != counters.majority(ties, 5)[0]).any()
    assert (made[1:] == counters.majority(ties, 5)[1:]).all()


def test_what_is_drawn_from_one_seed_is_drawn_apart():
    """Seed 0 broke the ties of class 1,000,003 as seed 1 those of class 0, and so on."""
    d = 64 * 40
    drawn = [
        *(tie_breaker(d, *pair) for pair in ((0, 0), (0, 1), (0, 1_000_003), (1, 0))),
        *(tie_breaker(d, seed, 0) for seed in (-1, -5, 2**32 + 5, 2**62, 2**64 - 5)),
        *replaced_bits(3, d, 0.5, seed=0),
        *replaced_bits(3, d, 0.5, seed=1),
        bits.random_hypervector(d, 0),
    ]
    distances = bits.hamming(torch.stack(drawn), torch.stack(drawn)) / d
    distances.fill_diagonal_(0.5)
    assert ((distances - 0.5).abs() < 0.06).all()  # six standard deviations
