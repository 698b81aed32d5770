"""Frames of one group are never on both sides of a split or a fold."""

import numpy as np
import pytest

from hdc.command import holdout
from hdc.command.compare.frames import part, read_frames
from hdc.readers import open_recording
from hdc.selection import folds

RNG = np.random.default_rng(0)


@pytest.fixture
def copies(tmp_path):
    """Forty objects, each three times with a little noise, of a random class: nothing can be
    recognised but the object itself."""
    objects = RNG.integers(0, 200, (40, 8, 8))
    group = np.repeat(np.arange(40), 3)
    frames = objects[group] + RNG.integers(0, 4, (120, 8, 8))
    labels = np.repeat(RNG.permutation(40) % 2, 3)
    path = tmp_path / "copies.npz"
    np.savez(path, frames=frames.astype(np.uint8), labels=labels, group=group)
    return path


def apart(group, one, other):
    return not set(group[one].tolist()) & set(group[other].tolist())


def test_whole_groups_are_held_out(copies):
    recording = open_recording(copies)
    train, test, how = holdout.hold_out(recording, 0.25)
    assert how == "in groups that training has not seen"
    assert apart(recording.group, train, test)
    assert len(test) == pytest.approx(30, abs=3)


def test_the_command_says_that_groups_were_kept_together(typed, copies, tmp_path):
    words = ("train", copies, "-o", tmp_path / "model", "--test-fraction", 0.25)
    status, said, _ = typed(*words)
    assert status == 0
    assert "held out in groups that training has not seen" in said
    assert "at random" not in said


def test_every_part_and_fold_of_a_comparison_keeps_groups_together(copies):
    recording = open_recording(copies)
    parts = part(recording, None, 0.25)
    group = recording.group
    assert apart(group, parts.earlier, parts.later)
    assert apart(group, parts.chosen_on, parts.random)
    frames = read_frames(recording)
    found, how = folds(frames, parts.chosen_on)
    assert how == "by group"
    assert len(found) > 1
    assert all(apart(group, train, test) for train, test in found)


def test_a_group_across_the_last_session_is_held_out_whole(copies, tmp_path):
    with np.load(copies) as data:
        stored = dict(data)
    path = tmp_path / "sessions.npz"
    np.savez(path, **stored, session=np.arange(120) % 3)
    recording = open_recording(path)
    assert holdout.last_sessions(recording, 0.3) is None
    train, test, how = holdout.hold_out(recording, 0.3)
    assert how == holdout.UNSEEN_GROUPS
    assert apart(recording.group, train, test)


def test_a_group_that_is_all_of_a_class_cannot_be_held_out():
    labels, group = np.array([0, 0, 1, 1]), np.array([7, 7, 8, 8])
    with pytest.raises(ValueError, match="group: expected two groups or more of each"):
        holdout.split_groups(labels, group, 0.5, 0)


def test_groups_are_held_out_of_each_class_alike():
    """They were drawn until they were enough: of one class more than of another."""
    labels = np.repeat(np.arange(3), 50)
    for seed in range(20):
        group = np.random.default_rng(seed).permutation(30)[np.arange(150) // 5]
        train, test = holdout.split_groups(labels, group, 0.2, seed)
        assert np.bincount(labels[test]).tolist() == [10, 10, 10]
        assert apart(group, train, test)


def test_each_class_is_tested_by_its_smallest_group_where_all_are_large():
    labels = np.repeat([0, 1], [9, 30])
    group = np.repeat([5, 6, 7, 8], [5, 4, 10, 20])
    _, test = holdout.split_groups(labels, group, 0.05, 0)
    assert set(group[test]) == {6, 7}
