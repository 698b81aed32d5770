"""Up to 19 frames of each class: which ones does not depend on batches, and chance is even."""

import numpy as np
import torch

from hdc.hypervectors import KEPT, Sample


def test_what_is_kept_does_not_depend_on_batches_and_has_a_share_of_each_time():
    words, rows = torch.arange(3000)[:, None], [0, 1, 0] * 1000
    samples = []
    for cuts in ([3000], [128] * 24, [1] * 3000):
        sample = Sample()
        for start, n in zip(np.cumsum([0, *cuts]), cuts, strict=False):
            end = start + n
            sample = sample.with_frames(words[start:end], rows[start:end])
        samples.append(sample.listed()[0])
        assert sample.seen == {0: 2000, 1: 1000}
    assert torch.equal(samples[0], samples[1])
    assert torch.equal(samples[0], samples[2])
    assert len(samples[0]) == len(set(samples[0].flatten().tolist())) == 2 * KEPT
    thirds = np.bincount(samples[0].flatten() // 1000, minlength=3)
    assert thirds.min() >= 5  # of 38
