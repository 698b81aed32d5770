"""A recording as a scene; what its readers do is tested beside them."""

import numpy as np
import pytest
import torch

from hdc import readers
from scenes.frames import Scene
from scenes.recorded import RecordedScene, open_recording


@pytest.fixture
def archive(tmp_path):
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 2**16, (6, 5, 4), dtype=np.uint16)
    path = tmp_path / "touches.npz"
    np.savez(path, frames=frames, labels=np.array(["a", "b"] * 3), session=np.arange(6) // 3)
    return path, frames


def test_a_recording_is_a_scene(archive):
    path, frames = archive
    scene = open_recording(path, crop=[1, 0, 3, 5], subsample=2)
    assert isinstance(scene, RecordedScene)
    assert isinstance(scene, Scene)
    assert (scene.origin, scene.classes, scene.shape) == ("recorded", ("a", "b"), (3, 2))
    assert scene.labels.tolist() == [0, 1] * 3
    assert scene.samples["session"].tolist() == [0, 0, 0, 1, 1, 1]
    assert (len(scene), scene.skipped) == (6, ())
    expected = torch.from_numpy(frames[:, ::2, 1:4:2].copy())
    assert torch.equal(scene.frames(torch.tensor([4, 1])), expected[[4, 1]])
    assert torch.equal(torch.stack(list(scene.stream())), expected)
    assert torch.equal(next(iter(scene.stream([3]))), expected[3])
    with pytest.raises(IndexError, match=r"expected values in \[0, 6\)"):
        scene.frames([6])
    same = readers.open_recording(path, crop=[1, 0, 3, 5], subsample=2)
    assert scene.fingerprint() == same.fingerprint() != open_recording(path).fingerprint()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"path": "/nowhere"}, r"^scene\.path: expected a folder, an .npz or a video, found noth"),
        ({"crop": [0, 0, 9, 9]}, r"^scene\.crop: expected a window inside frames 4 px wide"),
        ({"subsample": 0}, r"^scene\.subsample: expected an integer ≥ 1, found 0"),
    ],
)
def test_a_setting_is_named_as_in_the_configuration(archive, settings, message):
    with pytest.raises(ValueError, match=message):
        open_recording(**{"path": archive[0], **settings})
