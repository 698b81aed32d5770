"""A folder of images of three patterns, and a model of it."""

import os

import cv2
import numpy as np
import pytest

SIDE = 24


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    """Each command is typed in an empty folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def frames():
    """uint8 [3, 12, 24, 24]: twelve noisy frames of each of three patterns."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 150, (3, 1, SIDE, SIDE))
    return (base + rng.integers(0, 90, (3, 12, SIDE, SIDE))).astype(np.uint8)


@pytest.fixture
def write():
    """write(root, frames, classes) → root, with a sub-folder of images for each class."""

    def make(root, frames, classes="abc"):
        for name, images in zip(classes, frames, strict=True):
            os.makedirs(f"{root}/{name}", exist_ok=True)
            for i, image in enumerate(images):
                assert cv2.imwrite(f"{root}/{name}/{i}.png", image)
        return root

    return make


@pytest.fixture
def folder(tmp_path, frames, write):
    return write(tmp_path / "my frames [1]", frames)


@pytest.fixture
def model(hdc, folder, tmp_path):
    """A model of the published form."""
    path = tmp_path / "m.safetensors"
    words = ("--encoder", "median", "--readout", "majority")
    assert hdc("train", folder, "-o", path, *words)[0] == 0
    return path
