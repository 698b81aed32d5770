"""Counters of classes, their majority, and recalibration."""

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.prototypes import Counters, replaced_bits, tie_breaker
from hdc.readouts import Majority
from tests.hdc.own import fitted


def vectors(n, d, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).random((n, d)) < 0.5)


def counted(n_classes, mask, labels):
    counters = Counters(n_classes, mask.shape[1])
    counters.add(bits.pack(mask), torch.as_tensor(labels))
    return counters


def test_ties_of_a_seed_are_broken_by_an_added_hypervector():
    mask, labels = vectors(8, 300), [0, 1] * 4
    counters = counted(3, mask, labels)
    prototypes = counters.majority("random", seed=7)
    breakers = [bits.unpack(tie_breaker(300, 7, c), 300) for c in range(2)]
    added = counted(3, torch.cat([mask, torch.stack(breakers)]), [*labels, 0, 1])
    assert torch.equal(prototypes, added.majority())
    assert not torch.equal(prototypes, counters.majority("random", seed=8))
    assert not prototypes[2].any()  # a class without samples


ONE = torch.zeros(1, 1, dtype=torch.int64)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: c.add(ONE, torch.tensor([-1])), r"class indices in \[0, 2\), fo.* -1"),
        (lambda c: c.add(ONE, torch.tensor([2])), r"class indices in \[0, 2\), found 2"),
        (lambda c: c.add(ONE, torch.tensor([0, 0])), "expected 1, one a sample, found 2"),
        (lambda c: c.add(ONE[:, [0, 0]], torch.tensor([0])), "1 words for D = 64, found 2"),
        (lambda c: c.merge(Counters(2, 65)), "2 classes of D = 64, found 2 of D = 65"),
        (lambda c: replaced_bits(2, 64, float("nan"), 0), "p: expected a share .*nan"),
    ],
)  # fmt: skip
def test_what_cannot_be_counted_is_named_and_not_counted(call, message):
    counters = Counters(2, 64)
    with pytest.raises(ValueError, match=message):
        call(counters)
    assert counters.n.tolist() == [0, 0]


@pytest.mark.parametrize("p", [0.0, 0.1, 0.5, 1.0])
def test_replaced_bits_are_drawn_class_by_class_with_their_probability(p):
    drawn = bits.unpack(replaced_bits(3, 10_001, p, 2), 10_001)
    spread = (p * (1 - p) / 10_001) ** 0.5
    assert ((drawn.double().mean(1) - p).abs() <= 5 * spread).all()
    both = float((drawn[0] & drawn[1]).double().mean())
    assert both == pytest.approx(p * p, abs=0.02)  # drawn independently
    assert torch.equal(replaced_bits(2, 10_001, p, 2), bits.pack(drawn[:2]))


def test_recalibrated_bits_come_from_either_side():
    """What :meth:`hdc.readouts.Majority.adapt` makes of old and new prototypes."""
    rows = torch.arange(6) % 3
    old, new = bits.pack(vectors(6, 10_001)), bits.pack(vectors(6, 10_001, 1))
    model = fitted(Majority(), old, rows, 3, 10_001)
    stored = model.prototypes_.clone()
    fresh = fitted(Majority(), new, rows, 3, 10_001).prototypes_
    mixed = model.adapted(new, rows, 0.5, 2, "replace").prototypes_
    assert not ((mixed ^ stored) & (mixed ^ fresh)).any()
    changed = bits.hamming(stored, mixed) / bits.hamming(stored, fresh)
    assert ((changed.diagonal() - 0.5).abs() < 0.05).all()
    whole = model.adapted(new, rows, 1, 3, "replace").prototypes_
    assert torch.equal(whole, fresh)


def test_what_is_drawn_from_one_seed_is_drawn_apart():
    """Seed 0 broke the ties of class 1,000,003 as seed 1 those of class 0, and so on."""
    d = 64 * 40
    drawn = [
        *(tie_breaker(d, *pair) for pair in ((0, 0), (0, 1), (0, 1_000_003), (1, 0))),
        *(tie_breaker(d, seed, 0) for seed in (-1, -5, 2**32 + 5, 2**62, 2**64 - 5)),
        *replaced_bits(3, d, 0.5, seed=0),
        *replaced_bits(3, d, 0.5, seed=1),
        *replaced_bits(3, d, 0.5, seed=1, number=1),
        bits.random_hypervector(d, 0),
    ]
    distances = bits.hamming(torch.stack(drawn), torch.stack(drawn)) / d
    distances.fill_diagonal_(0.5)
    assert ((distances - 0.5).abs() < 0.06).all()  # six standard deviations
