"""Folds of training frames, whole groups in one of them."""

import numpy as np
import pytest

from baselines.folds import folds


@pytest.mark.parametrize("nested", [False, True])
def test_frames_of_a_group_are_in_one_fold(nested):
    """Whether groups have frames of every class, or each of one class."""
    labels, groups = np.arange(60) % 2, np.arange(60) // 10
    if nested:
        groups = 2 * groups + labels
    rows = np.arange(3, 60)
    made, how = folds(labels, rows, session=groups)
    assert (len(made), how) == (5, "by session")
    for train, test in made:
        assert not set(groups[train]) & set(groups[test])
        assert set(labels[train]) == {0, 1}
    tested = np.concatenate([test for _, test in made])
    assert sorted(tested) == rows.tolist()
    # Each class is of one group only.
    assert folds(labels, rows, session=labels)[1] == "at random"
    assert folds(labels, rows, group=groups)[1] == "by group"


@pytest.mark.parametrize(
    ("numbers", "count"),
    [([2, 2], 2), ([3, 9], 3), ([200, 130, 7], 5), ([1, 9], 0), ([1, 1], 0), ([3], 0)],
)
def test_folds_at_random_are_dealt_class_by_class(numbers, count):
    """As cards, by plain loops from numpy's permutation of seed 0: the same on every machine.

    Of too few frames there are none.
    """
    labels = np.random.default_rng(1).permutation(
        np.repeat(np.arange(len(numbers)), numbers)
    )
    rows = np.arange(len(labels))[::-1]
    shuffled = np.random.default_rng(0).permutation(len(rows)).tolist()
    dealt = sorted(shuffled, key=lambda place: labels[rows[place]])
    made, how = folds(labels, rows)
    assert (len(made), how) == (count, "at random")
    for k, (train, test) in enumerate(made):
        own = sorted(dealt[k::count])
        assert test.tolist() == rows[own].tolist()
        assert train.tolist() == np.delete(rows, own).tolist()
        assert set(labels[train]) == set(labels[test]) == set(range(len(numbers)))
