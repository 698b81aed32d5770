"""Small frames on which the laws can be checked in seconds."""

import numpy as np
import pytest
import torch
from torch import Tensor


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


class Lazy:
    """A FrameSource that makes its frames only when indexed."""

    def __init__(self, images):
        self._images = images
        self.shape = tuple(images.shape)

    def __len__(self):
        return len(self._images)

    def __getitem__(self, index):
        assert isinstance(index, slice | Tensor)
        return self._images[index].clone()


@pytest.fixture
def lazy():
    return Lazy
