"""A small recording of three classes, as a folder of images."""

import numpy as np
import pytest

from tests.hdc.readers.writers import write_image


@pytest.fixture(scope="session")
def pixels():
    """uint8 [12, 20, 30]: frames of which no two are alike."""
    return np.random.default_rng(0).integers(0, 256, (12, 20, 30), dtype=np.uint8)


@pytest.fixture
def images(pixels):
    """images(root, *names) → root, with the first frames under these names."""

    def make(root, *names):
        for name, frame in zip(names, pixels, strict=False):
            write_image(root / name, frame)
        return root

    return make


@pytest.fixture
def folder(tmp_path, images):
    """Four frames of each class: a/1.png … a/4.png, b/…, c/…"""
    names = (f"{label}/{k}.png" for label in "abc" for k in range(1, 5))
    return images(tmp_path / "recording", *names)
