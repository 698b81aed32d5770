"""A recording as a scene; its readers are tested with hdc."""

import numpy as np
import pytest
import torch

from scenes.frames import Scene
from scenes.recorded import open_recording


@pytest.fixture
def archive(tmp_path):
    frames = np.random.default_rng(0).integers(0, 2**16, (6, 5, 4), dtype=np.uint16)
    path = tmp_path / "touches.npz"
    np.savez(
        path, frames=frames, labels=np.array(["a", "b"] * 3), session=np.arange(6) // 3
    )
    return path, frames


def test_a_recording_is_a_scene(archive):
    path, frames = archive
    scene = open_recording(path, crop=[1, 0, 3, 5], subsample=2)
    assert isinstance(scene, Scene)
    assert (scene.origin, scene.classes, scene.shape) == (
        "recorded",
        ("a", "b"),
        (3, 2),
    )
    assert scene.labels.tolist() == [0, 1] * 3
    assert scene.samples["session"].tolist() == [0, 0, 0, 1, 1, 1]
    assert len(scene) == 6
    expected = torch.from_numpy(frames[:, ::2, 1:4:2].copy())
    assert torch.equal(scene.frames(torch.tensor([4, 1])), expected[[4, 1]])
    with pytest.raises(IndexError, match=r"expected values in \[0, 6\)"):
        scene.frames([6])
    assert scene.fingerprint() != open_recording(path).fingerprint()
