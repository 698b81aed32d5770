"""Scenes in memory, and classes of a continuous value."""

import numpy as np
import torch

from scenes.frames import Frames, level_classes


def frames(dtype=np.uint8, **changed):
    images = torch.from_numpy(np.arange(24, dtype=dtype).reshape(4, 2, 3))
    given = {"images": images, "labels": np.array([0, 1, 0, 1]), "classes": ("a", "b")}
    return Frames(**{**given, **changed})


def test_the_fingerprint_changes_with_all_that_a_result_depends_on():
    scene = frames()
    assert frames().fingerprint() == scene.fingerprint()
    pixel = scene.images.clone()
    pixel[0, 0, 0] ^= 1
    changed = [
        frames(images=pixel),
        frames(images=scene.images.reshape(4, 3, 2)),
        frames(labels=np.array([0, 1, 1, 0])),
        frames(classes=("a", "c")),
        frames(samples={"order": np.array([3, 2, 1, 0])}),
        frames(dtype=np.uint16),
    ]
    assert len({scene.fingerprint(), *(other.fingerprint() for other in changed)}) == 7


def test_an_edge_belongs_to_the_class_below_it():
    names, index = level_classes(np.array([0.5, 1.0, 1.5, 2.0, 3.0]), [1.0, 2.0], "mm")
    assert names == ("≤ 1 mm", "1–2 mm")
    assert index.tolist() == [0, 0, 1, 1, 2]
