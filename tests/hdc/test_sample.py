"""Up to 19 frames of each class: which ones does not depend on batches, and chance is even."""

import numpy as np
import torch

from hdc.sample import KEPT, Reservoir


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
