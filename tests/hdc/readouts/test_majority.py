"""Majority and counts with classes of unequal size: as published, and as if all had as many."""

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.prototypes import Counters
from hdc.readouts import Majority


def frames_of(*numbers):
    """Noise in classes of these numbers."""
    labels = np.repeat(np.arange(len(numbers)), numbers)
    return np.random.default_rng(0).random((len(labels), 30)), labels


def test_larger_classes_are_warned_of_unless_they_are_meant():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        HDCClassifier().fit(*frames_of(6, 5, 5))
        HDCClassifier(readout=Majority()).fit(*frames_of(9, 4, 4))
    with pytest.warns(UserWarning, match=r"largest class has 125 % more .* alike\)$"):
        HDCClassifier().fit(*frames_of(9, 4, 4))


def test_thinned_counts_are_those_of_random_subsets():
    n, size = 12, 5
    ones = torch.arange(13).repeat(4000)[None]  # each count 4000 times
    rows = torch.arange(n)[:, None] < ones  # row i has a one where more than i do
    counters = Counters(2, 52_000)
    counters.add(
        bits.pack(torch.cat((rows, rows[:4]))), torch.tensor([0] * n + [1] * 4)
    )
    thinned = counters.thinned(size, seed=3)
    assert thinned.n.tolist() == [size, 4]
    assert torch.equal(thinned.counts()[1], ones[0].clamp(max=4))
    drawn = thinned.counts()[0].double().view(4000, 13)
    k = torch.arange(13).double()
    variance = size * k / n * (1 - k / n) * (n - size) / (n - 1)
    assert ((drawn.mean(0) - size * k / n).abs() <= 5 * (variance / 4000).sqrt()).all()
    torch.testing.assert_close(drawn.var(0), variance, rtol=0.15, atol=1e-12)
    assert not torch.equal(counters.thinned(size, seed=4).planes, thinned.planes)
