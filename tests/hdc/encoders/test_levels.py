"""Levels of the pixels that are lit in training."""

import numpy as np
import pytest
import torch

from hdc.encoders import Levels


@pytest.mark.filterwarnings("ignore:.*order of pixels")
def test_lit_pixels_alone_are_ranked_by_the_mean_of_all_training_frames():
    """More frames than are summed at a time; a share of at least 0.5 of a mean of 4, too."""
    frames = np.zeros((150, 4), np.uint8)
    frames[:75, 0] = 160  # mean 80
    frames[:, 1] = 20
    frames[149, 2] = 90  # mean 0.6
    frames[:, 3] = 59
    equal = np.array([[1, 3, 0, 5], [1, 1, 1, 4]], np.uint8)  # sums of 2, 4, 1 and 9
    for given, share, lit in (
        (frames, 0.01, [1, 1, 1, 1]),
        (frames, 0.02, [1, 1, 0, 1]),
        (frames, 0.6, [1, 0, 0, 1]),
        (equal, 0.5, [1, 1, 0, 1]),
    ):
        encoder = Levels(3, lit=share).fit(given)
        assert encoder.lit_.int().tolist() == lit
        assert encoder.dimension(4) == 3 * sum(lit)
        asked = torch.from_numpy(given[-9:].reshape(-1, 2, 2))
        expected = Levels(3).encode(asked.flatten(1)[:, np.flatnonzero(lit)])
        assert torch.equal(encoder.encode(asked), expected)
    message = "lit: expected at least two lit pixels, found 1"
    with pytest.raises(ValueError, match=message):
        Levels(lit=0.99).fit(np.array([[0, 0, 9]]))
