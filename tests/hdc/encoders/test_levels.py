"""Levels: what their bits mean, and the choice of lit pixels."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.encoders import Levels


def test_distances_are_those_of_ranks():
    """With T + 1 pixels, all different, the distance is the L1 distance of their ranks."""
    rng = np.random.default_rng(0)
    frames = np.stack([rng.permutation(8) for _ in range(12)]).astype(np.uint8)
    words = Levels(7).encode(torch.from_numpy(frames))
    expected = np.abs(frames[:, None].astype(int) - frames).sum(2)
    assert np.array_equal(bits.hamming(words, words).numpy(), expected)


def test_lit_pixels_alone_are_ranked():
    rng = np.random.default_rng(0)
    frames = rng.integers(50, 200, (30, 10, 20)).astype(np.uint8)
    dark = rng.random((10, 20)) < 0.4
    frames[:, dark] = rng.integers(0, 4, (30, dark.sum()))
    encoder = Levels(3, lit=0.2).fit(frames)
    assert np.array_equal(encoder.lit_.numpy(), ~dark.ravel())
    assert encoder.dimension(200) == 3 * (~dark).sum()
    lit = torch.from_numpy(frames[:, ~dark])
    assert torch.equal(encoder.encode(torch.from_numpy(frames)), Levels(3).encode(lit))
    frames[:, dark] = 255  # whatever the others are
    assert torch.equal(encoder.encode(torch.from_numpy(frames)), Levels(3).encode(lit))


def test_which_pixels_are_lit_is_by_the_mean_of_all_training_frames():
    """More frames than are summed at a time; a share of at least 0.5 of a mean of 4, too."""
    frames = np.zeros((150, 4), np.uint8)
    frames[:75, 0] = 160  # mean 80
    frames[:, 1] = 20
    frames[149, 2] = 90  # mean 0.6
    frames[:, 3] = 59
    equal = np.array([[1, 3, 0, 5], [1, 1, 1, 4]], np.uint8)  # sums of 2, 4, 1 and 9
    for given, share, expected in (
        (frames, 0.01, [1, 1, 1, 1]),
        (frames, 0.02, [1, 1, 0, 1]),
        (frames, 0.6, [1, 0, 0, 1]),
        (equal, 0.5, [1, 1, 0, 1]),
    ):
        assert Levels(3, lit=share).fit(given).lit_.int().tolist() == expected
    with pytest.raises(
        ValueError, match="lit: expected at least two lit pixels, found 1"
    ):
        Levels(lit=0.99).fit(np.array([[0, 0, 9]]))
