"""Which frames are tested: whole sessions, else whole groups, else frames, of every class."""

from dataclasses import dataclass

import numpy as np
import pytest

from hdc.command import splits


@dataclass
class Made:
    """A recording without frames."""

    labels: np.ndarray | None
    session: np.ndarray | None = None
    group: np.ndarray | None = None
    values: np.ndarray | None = None
    classes: tuple[str, ...] = ("air", "oil", "wax")

    def __len__(self):
        return len(self.values if self.labels is None else self.labels)


def made(labels, session=None, group=None):
    columns = (None if c is None else np.array(c) for c in (session, group))
    return Made(np.array(labels), *columns)


ROUNDS = [0, 1] * 6
NO_SESSIONS = "no sessions are known"


@pytest.mark.parametrize(
    ("recording", "fraction", "kind", "held", "why"),
    [
        # The last sessions; at least one, and one is left.
        (made(ROUNDS, np.arange(12) // 2), 0.3, "session", [8, 9, 10, 11], ""),
        (made(ROUNDS, np.arange(12) // 2), 0.01, "session", [10, 11], ""),
        (made(ROUNDS, np.arange(12) // 2), 0.99, "session", [*range(2, 12)], ""),
        (made([0, 1, 0, 1], [7, 7, 3, 3]), 0.5, "session", [0, 1], ""),
        # The last session of each class, where sessions are of one class: it tested one class.
        (made(np.arange(12) // 6, np.arange(12) // 2), 0.3, "session", [4, 5, 10, 11], ""),
        # A class of one session, a group of two, one session alone.
        (made([0, 0, 1, 1, 0], [0, 1, 0, 0, 1]), 0.4, "frame", None,
         "a class has frames from one session only"),
        (made(ROUNDS, [3] * 12), 0.3, "frame", None,
     "a class has frames from one session only"),
        (made(ROUNDS, np.arange(12) % 3, np.arange(12)), 0.3, "session", None, ""),
        (made(ROUNDS, np.arange(12) // 4, np.arange(12) % 4), 0.3, "group", None,
         "a group has frames from several sessions"),
        (made(ROUNDS, None, np.arange(12) // 3), 0.25, "group", None, ""),
        (made(ROUNDS), 0.34, "frame", None, NO_SESSIONS),
    ],
)  # fmt: skip
def test_what_is_held_out_is_whole_and_of_every_class(
    recording, fraction, kind, held, why
):
    (train, test), unit = splits.hold_out(recording, fraction)
    assert unit.kind == kind
    assert unit.why.startswith(why)
    assert bool(unit.why) == bool(why)
    assert sorted([*train, *test]) == list(range(len(recording)))
    assert (np.diff(train) > 0).all()
    assert (np.diff(test) > 0).all()
    assert set(recording.labels[train]) == set(recording.labels[test]) == {0, 1}
    assert not set(unit.of[train]) & set(unit.of[test])
    if held is not None:
        assert test.tolist() == held
    again, _ = splits.hold_out(recording, fraction)
    assert all(map(np.array_equal, (train, test), again))


@pytest.mark.parametrize(
    ("n", "group", "fraction", "held"),
    [(4, None, 0.01, 1), (4, None, 0.5, 2), (4, None, 0.99, 3), (50, 5, 0.2, 10)],
)
def test_of_each_class_the_same_share_is_held_out(n, group, fraction, held):
    """Groups were drawn until they were enough: of one class more than of another."""
    labels = np.repeat([0, 1, 2], n)
    for seed in range(5):
        units = np.random.default_rng(seed).permutation(3 * n)[np.arange(3 * n) // 5]
        recording = made(labels, None, units if group else None)
        (_, test), _ = splits.hold_out(recording, fraction)
        assert np.bincount(labels[test]).tolist() == [held] * 3
    numbers = Made(None, values=np.zeros((n, 1)))  # of numbers, of all frames
    (_, test), _ = splits.hold_out(numbers, fraction)
    assert len(test) == held


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        (made([0, 0, 2]), "--test-fraction: expected a frame .* found too few of wax"),
        (made([0, 0, 1, 1], None, [7, 7, 8, 8]), "expected a group .* found too few of air"),
        # Each two classes share a group: of two that are tested, a third learns nothing.
        (made([0, 0, 1, 1, 2, 2], None, [1, 2, 2, 3, 1, 3]), "expected a group .* too few of"),
        (Made(None, values=np.zeros((1, 1))), "expected a frame .* found too few \\("),
    ],
)  # fmt: skip
def test_what_cannot_be_held_out_is_refused(recording, message):
    with pytest.raises(ValueError, match=message):
        splits.hold_out(recording, 0.5)


@pytest.mark.parametrize(
    ("recording", "kind", "count"),
    [
        (made(ROUNDS, np.arange(12) // 3), "session", 4),
        (made(np.arange(40) % 2, np.arange(40) // 2), "session", 5),  # more than ten
        (made(np.arange(12) % 2, None, np.arange(12) // 4), "group", 3),
        (made(ROUNDS), "frame", 5),
        (made([0, 0, 0, 1, 1, 0]), "frame", 2),
    ],
)
def test_folds_test_each_frame_once_and_learn_every_class(recording, kind, count):
    found, unit = splits.folds(recording)
    assert (unit.kind, len(found)) == (kind, count)
    tested = np.concatenate([test for _, test in found])
    assert sorted(tested) == list(range(len(recording)))
    for train, test in found:
        assert set(recording.labels[train]) == {0, 1}
        assert not set(unit.of[train]) & set(unit.of[test])
        assert sorted([*train, *test]) == list(range(len(recording)))


def test_a_class_of_a_single_unit_has_no_folds():
    message = "cross-validation: expected two groups or more of each class, found one"
    with pytest.raises(ValueError, match=message):
        splits.folds(made([0, 0, 1, 1], None, [7, 8, 9, 9]))
