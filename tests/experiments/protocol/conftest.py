"""Frames of a few classes for tests of what trains and tests, and of how frames are held."""

import numpy as np
import pytest
import torch

from scenes.frames import Frames


@pytest.fixture(scope="session")
def make_scene():
    """make_scene(n, classes, shape, …) → noisy frames of so many classes, one after another."""

    def make(
        n=60, classes=3, shape=(5, 7), dtype=np.uint8, origin="simulated", sessions=1
    ):
        rng = np.random.default_rng(0)
        labels = np.tile(np.arange(classes), n // classes)
        base = rng.integers(0, np.iinfo(dtype).max // 2, (classes, *shape))
        noise = rng.integers(0, np.iinfo(dtype).max // 2, (n, *shape))
        return Frames(
            torch.from_numpy((base[labels] + noise).astype(dtype)),
            labels,
            tuple("abc"[:classes]),
            {"session": np.repeat(np.arange(sessions), n // sessions)},
            origin=origin,
        )

    return make
