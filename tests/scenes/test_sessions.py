"""Scenes in memory, and two sessions made of recordings: which frames are in which."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenes.frames import Frames
from scenes.sessions import Halves, Joined


def scene(n, side=4, classes="ab", seed=0):
    pixels = np.random.default_rng(seed).integers(0, 256, (n, side, side), np.uint8)
    labels = np.arange(n) % len(classes)
    order = np.arange(n)[::-1].copy()
    return Frames(torch.from_numpy(pixels), labels, tuple(classes), {"order": order})


def test_the_fingerprint_changes_with_all_that_a_result_depends_on():
    same = scene(4)
    changes = [
        {"images": same.images.flip(0)},
        {"images": same.images.reshape(4, 2, 8)},
        {"images": same.images.view(torch.int8)},
        {"labels": 1 - same.labels},
        {"classes": ("a", "c")},
        {"samples": {}},
    ]
    prints = {replace(same, **change).fingerprint() for change in [{}, *changes]}
    assert len(prints) == len(changes) + 1
    assert scene(4).fingerprint() in prints


def test_halves_are_the_earlier_and_the_later_frames_of_each_class():
    recording = scene(20)
    halves = Halves(recording)
    for label in range(2):
        of_class, session = halves.labels == label, halves.samples["session"]
        times = [recording.samples["order"][of_class & (session == s)] for s in (0, 1)]
        assert len(times[0]) == len(times[1]) == 5
        assert times[0].max() < times[1].min()
    assert torch.equal(halves.frames([3, 1]), recording.frames([3, 1]))
    assert halves.fingerprint() != recording.fingerprint()


def test_joined_scenes_are_sessions_in_their_order():
    first, second = scene(6), scene(8, classes="xy", seed=1)
    joined = Joined({"a": first, "b": second})
    assert joined.classes == ("a", "b")
    assert joined.samples["session"].tolist() == [0] * 6 + [1] * 8
    every = torch.cat([first.images, second.images])
    assert torch.equal(joined.frames([7, 0, 13]), every[[7, 0, 13]])
    message = r"scene\.scenes: expected 2 classes of frames \(4, 4\)"
    with pytest.raises(ValueError, match=message):
        Joined({"a": first, "b": scene(6, side=5)})
