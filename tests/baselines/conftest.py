"""Small frames on which the laws can be checked in seconds."""

import numpy as np
import pytest
import torch


def make_speckle(n, shape, classes, seed=0):
    """Noisy speckle frames uint8 [n, H, W] about one pattern a class, and labels [n] in turn."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % classes
    patterns = rng.exponential(1.0, (classes, *shape))
    mixed = 0.5 * patterns[labels] + 0.5 * rng.exponential(1.0, (n, *shape))
    return torch.from_numpy(np.clip(50 * mixed, 0, 255).astype(np.uint8)), labels


@pytest.fixture(name="speckle")
def speckle_maker():
    return make_speckle


@pytest.fixture
def small():
    """40 frames of 12×10 pixels in 4 classes."""
    return make_speckle(40, (12, 10), 4)
