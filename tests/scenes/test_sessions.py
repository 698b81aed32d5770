"""Two sessions made of recordings: which frames are in which, and that they are the same frames."""

import numpy as np
import pytest
import torch

from scenes.frames import Frames
from scenes.sessions import Halves, Joined


def scene(n, side=4, classes="ab", seed=0):
    generator = torch.Generator().manual_seed(seed)
    images = torch.randint(
        0, 256, (n, side, side), generator=generator, dtype=torch.uint8
    )
    labels = np.arange(n) % len(classes)
    return Frames(images, labels, tuple(classes), {"order": np.arange(n)[::-1].copy()})


def test_halves_are_the_earlier_and_the_later_frames_of_each_class():
    recording = scene(20)
    halves = Halves(recording)
    for label in range(2):
        of_class, session = halves.labels == label, halves.samples["session"]
        times = [recording.samples["order"][of_class & (session == s)] for s in (0, 1)]
        assert len(times[0]) == len(times[1]) == 5
        assert times[0].max() < times[1].min()
    assert torch.equal(halves.frames([3, 1]), recording.frames([3, 1]))
    assert halves.fingerprint() != Halves(recording, 0.3).fingerprint()


def test_joined_scenes_are_sessions_in_their_order():
    first, second = scene(6), scene(8, classes="xy", seed=1)
    joined = Joined({"a": first, "b": second})
    assert joined.classes == ("a", "b")
    assert joined.samples["session"].tolist() == [0] * 6 + [1] * 8
    assert torch.equal(joined.frames([7, 0, 13]), torch.stack(
        [second.images[1], first.images[0], second.images[7]]
    ))  # fmt: skip
    with pytest.raises(
        ValueError, match=r"scene\.scenes: expected 2 classes of frames \(4, 4\)"
    ):
        Joined({"a": first, "b": scene(6, side=5)})
