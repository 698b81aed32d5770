"""Scenes in memory."""

import numpy as np
import torch

from scenes.frames import Frames


def frames(dtype=np.uint8, **changed):
    images = torch.from_numpy(np.arange(24, dtype=dtype).reshape(4, 2, 3))
    given = {"images": images, "labels": np.array([0, 1, 0, 1]), "classes": ("a", "b")}
    return Frames(**{**given, **changed})


def test_the_fingerprint_changes_with_all_that_a_result_depends_on():
    images = frames().images
    made = [
        frames(),
        frames(images=images.flip(0)),
        frames(images=images.reshape(4, 3, 2)),
        frames(labels=np.array([0, 1, 1, 0])),
        frames(classes=("a", "c")),
        frames(samples={"order": np.array([3, 2, 1, 0])}),
        frames(dtype=np.uint16),
    ]
    assert len({scene.fingerprint() for scene in [frames(), *made]}) == len(made)
