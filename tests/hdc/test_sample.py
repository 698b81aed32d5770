"""Up to 19 frames of each class: which ones does not depend on batches, and chance is even."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.stats import chisquare

from hdc import sample as sampling
from hdc.sample import KEPT, Reservoir, Sample


def test_what_is_kept_does_not_depend_on_batches_and_has_a_share_of_each_time():
    words, labels = torch.arange(3000)[:, None], ["a", "b", "a"] * 1000
    samples = []
    for cuts in ([3000], [128] * 24, [1] * 3000):
        reservoir = Reservoir()
        for start, n in zip(np.cumsum([0, *cuts]), cuts, strict=False):
            reservoir.add(words[start : start + n], labels[start : start + n])
        sample = reservoir.sample()
        samples.append(torch.cat([sample.kept["a"], sample.kept["b"]]))
        assert sample.seen == {"a": 2000, "b": 1000}
    assert torch.equal(samples[0], samples[1])
    assert torch.equal(samples[0], samples[2])
    assert len(samples[0]) == len(set(samples[0].flatten().tolist())) == 2 * KEPT
    thirds = np.bincount(samples[0].flatten() // 1000, minlength=3)
    assert thirds.min() >= 5  # of 38


def drawn(numbers: torch.Tensor) -> Sample:
    """A sample of hypervectors of one word, all of class "a"."""
    reservoir = Reservoir()
    reservoir.add(numbers[:, None], ["a"] * len(numbers))
    return reservoir.sample()


@pytest.mark.parametrize("sizes", [(300, 300), (30, 400), (5, 40)])
def test_every_frame_of_merged_samples_is_kept_with_the_same_chance(sizes, monkeypatch):
    n = sum(sizes)
    kept = []
    for seed in range(500):
        monkeypatch.setattr(sampling, "_SEED", seed + 10_000)
        other = drawn(torch.arange(sizes[0], n))
        monkeypatch.setattr(sampling, "_SEED", seed)
        mine = drawn(torch.arange(sizes[0]))
        sample, again = mine.merged(other), mine.merged(other)
        assert sample.seen == {"a": n}
        assert torch.equal(again.kept["a"], sample.kept["a"])
        found = sample.kept["a"][:, 0].tolist()
        assert len(set(found)) == min(KEPT, n)
        kept += found
    counts, _ = np.histogram(kept, bins=15, range=(0, n))
    assert chisquare(counts).statistic < 2.2 * 14
