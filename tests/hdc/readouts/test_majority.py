"""Majority and counts with classes of unequal size: as published, and as if all had as many."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.prototypes import Counters
from hdc.readouts import READOUTS, Counts, Majority
from tests.hdc.own import Learned, fitted


def frames_of(numbers: list[int], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames that share a field, as speckle of one sensor does, in classes of these numbers."""
    fields = np.random.default_rng(seed).normal(0, 1, (6, 6000))
    rng = np.random.default_rng([seed, *numbers])
    labels = np.repeat(np.arange(5), numbers)
    noise = rng.normal(0, 2.5, (len(labels), 6000))
    return 2 * fields[5] + 0.45 * fields[labels] + noise, labels


@pytest.mark.parametrize("name", READOUTS)
def test_larger_classes_are_warned_of_unless_they_are_meant(name):
    """A larger class may take frames of the others, whatever the read-out."""
    for numbers in ([6, 5, 5, 5, 5], [5] * 5):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            HDCClassifier(readout=name).fit(*frames_of(numbers, 0))
            HDCClassifier(readout=READOUTS[name]()).fit(*frames_of([9, 4, 4, 4, 4], 0))
    with pytest.warns(UserWarning, match=r"largest class has 125 % more .* alike\)$"):
        HDCClassifier(readout=name).fit(*frames_of([9, 4, 4, 4, 4], 0))


@pytest.mark.parametrize("readout", [Majority, Counts])
def test_balanced_classes_of_equal_size_are_as_published(readout):
    """Whatever their sizes were on the way."""
    frames, labels = frames_of([6] * 5, 0)
    published, balanced = (
        HDCClassifier(readout=readout(class_weight=w)).fit(frames, labels)
        for w in (None, "balanced")
    )
    for batch in (None, labels == 0, labels > 0):
        if batch is not None:
            for model in (published, balanced):
                model.partial_fit(frames[batch], labels[batch])
        scores = [model.decision_function(frames) for model in (published, balanced)]
        assert np.array_equal(*scores) == (np.ptp(published.counts_) == 0)


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
    assert torch.equal(counters.thinned(size, seed=3).planes, thinned.planes)
    assert not torch.equal(counters.thinned(size, seed=4).planes, thinned.planes)


@pytest.mark.parametrize("readout", [Majority, Counts])
def test_what_is_added_merged_and_arranged_before_settling_is_all_learnt(readout):
    """Samples of class 0 added, of class 2 merged, and class 1 put between; as all at once."""
    rng = np.random.default_rng(0)
    words = bits.pack(torch.from_numpy(rng.random((24, 130)) < 0.5))
    rows = torch.arange(24) % 3
    part = readout("random", random_state=4)
    whole = fitted(part, words, rows, 3, 130)
    first, last = rows == 0, rows == 2
    of_no_samples = Learned(part, part.empty(1, 130, "cpu"), 130)
    other = fitted(part, words[last], rows[last] - 2, 1, 130)
    model = of_no_samples.added(words[first][:2], rows[first][:2]).arranged([0], 2)
    model = model.added(words[first][2:], rows[first][2:]).merged(other, [1])
    model = model.merged(of_no_samples, [1]).arranged([0, 2], 3)
    model = model.added(words[rows == 1], rows[rows == 1])
    assert torch.equal(model.counters().counts(), whole.counters().counts())
    assert torch.equal(model.prototypes_, whole.prototypes_)
    assert torch.equal(model.scores(words), whole.scores(words))
