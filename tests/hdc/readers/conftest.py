"""A small recording of three classes, as a folder of images."""

import cv2
import numpy as np
import pytest


@pytest.fixture(scope="session")
def pixels():
    """uint8 [12, 20, 30]: frames of which no two are alike."""
    return np.random.default_rng(0).integers(0, 256, (12, 20, 30), dtype=np.uint8)


@pytest.fixture
def folder(tmp_path, pixels):
    """Four frames of each class: a/1.png … a/4.png, b/…, c/…"""
    root = tmp_path / "recording"
    for i, image in enumerate(pixels):
        path = root / "abc"[i // 4] / f"{i % 4 + 1}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), image)
    return root
