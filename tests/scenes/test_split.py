"""Splits: laws that hold for any labels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.split import (
    learning_curve_subset,
    leave_group_out,
    neighbours_leak,
    split,
)

seeds = st.integers(0, 2**32)


@st.composite
def labelled(draw, least=4):
    """Labels of 2-6 classes, unequal, not contiguous, in any order."""
    names = draw(st.lists(st.integers(0, 99), min_size=2, max_size=6, unique=True))
    counts = [draw(st.integers(least, 40)) for _ in names]
    labels = np.repeat(names, counts)
    return np.random.default_rng(draw(seeds)).permutation(labels)


def counts_of(labels, names):
    return np.array([(labels == name).sum() for name in names])


def parted(labels, **settings):
    """A split, which is the same again and a partition with every class on both sides."""
    train, test = split(labels, **settings)
    assert sorted([*train, *test]) == list(range(len(labels)))
    assert set(labels[train]) == set(labels[test]) == set(labels)
    for one, again in zip((train, test), split(labels, **settings), strict=True):
        assert np.array_equal(one, again)
    return train, test


@given(
    labelled(), st.sampled_from([0.25, 0.4, 0.5]), seeds, st.sampled_from(["random", "ordered"])
)  # fmt: skip
def test_a_split_is_stratified_and_tests_on_what_came_last(
    labels, fraction, seed, kind
):
    order = np.random.default_rng(seed).permutation(len(labels))
    train, test = parted(
        labels, test_fraction=fraction, kind=kind, seed=seed, order=order
    )
    names = np.unique(labels)
    share = len(test) / len(labels) * counts_of(labels, names)
    assert (np.abs(counts_of(labels[test], names) - share) < 1).all()
    if kind == "ordered":
        assert (np.diff(order[train]) > 0).all()
        for name in names:
            of_class = [order[part[labels[part] == name]] for part in (train, test)]
            assert of_class[0].max() < of_class[1].min()


@given(labelled(least=6), st.sampled_from([0.2, 0.4]), seeds, st.booleans())
def test_a_grouped_split_never_parts_a_group(labels, fraction, seed, across):
    """Groups of one or two samples of a class, as near as they allow, or across all classes."""
    names = np.unique(labels)
    groups = 1000 * labels + np.arange(len(labels)) // 2
    if across:
        rng = np.random.default_rng(seed)
        groups = rng.choice([3, 5, 8, 13, 21], len(labels), p=[0.1, 0.1, 0.2, 0.2, 0.4])
        for name in names:  # every class is in two groups at least
            groups[np.flatnonzero(labels == name)[:2]] = 3, 5
    settings = {"test_fraction": fraction, "kind": "grouped", "seed": seed}
    try:
        train, test = parted(labels, groups=groups, **settings)
    except ValueError as error:  # two others' test needed the only groups of a class
        assert across
        assert "split.groups: expected groups of class" in str(error)  # noqa: PT017
        return
    assert not set(groups[train]) & set(groups[test])
    share = fraction * counts_of(labels, names)
    assert across or (np.abs(counts_of(labels[test], names) - share) <= 2).all()


def test_neighbours_in_time_leak_through_a_random_split_only():
    labels = np.repeat([0, 1, 2, 3, 4], 100)  # one touch after the other
    order = np.random.default_rng(7).permutation(500)  # wherever in the file they are
    labels = labels[order]
    one = np.zeros(500)  # session
    random = neighbours_leak(labels, order, *split(labels), one)
    assert random == pytest.approx(1 - 0.2**2, abs=0.06)  # of 100
    ordered = split(labels, kind="ordered", order=order)
    found = neighbours_leak(labels, order, *ordered, one)
    assert found == 5 / 100  # the first of each class
    grouped = split(labels, kind="grouped", groups=order // 20)
    assert neighbours_leak(labels, order, *grouped, one) <= 0.1
    taken_in_turn = np.arange(500) % 5
    parts = split(taken_in_turn)
    assert neighbours_leak(taken_in_turn, np.arange(500), *parts, one) == 0


def test_neighbours_are_of_one_session():
    """Of two sessions that hide each other's: tests/experiments/protocol/test_splits.py."""
    session = np.repeat([0, 1], 200)
    last_and_first = np.ones(400, int), np.arange(400), np.array([199]), np.array([200])
    assert neighbours_leak(*last_and_first, session) == 0
    assert neighbours_leak(*last_and_first, 0 * session) == 1


@given(labelled(), seeds, st.data())
def test_learning_curve_subsets_are_nested_and_stratified(labels, seed, data):
    train, _ = split(labels, test_fraction=0.25, seed=seed)
    names = np.unique(labels)
    sizes = data.draw(
        st.lists(st.integers(len(names), len(train)), min_size=1, max_size=6)
    )
    in_training = counts_of(labels[train], names)
    if (in_training == in_training[0]).all():  # then classes have as many at every size
        sizes = [size // len(names) * len(names) for size in sizes]
    before: set[int] = set()
    for n in sorted(set(sizes)):
        chosen = learning_curve_subset(train, labels, n, seed)
        assert len(set(chosen)) == n
        assert before <= set(chosen) <= set(train)
        before = set(chosen)
        got = counts_of(labels[chosen], names)
        assert got.min() >= 1
        # Half a sample of rounding a class can add up in one class; and one a class comes first,
        # so a small class may hold a sample more than its share.
        share = n / len(train) * counts_of(labels[train], names)
        rounding = max(0.5, (share < 1).any())
        assert (np.abs(got - share) <= 1 + (len(names) - 1) * rounding).all()


LABELS = np.arange(20) % 2


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"test_fraction": 1.0}, r"test_fraction: expected a number in \(0, 1\), foun"),
        (
            {"test_fraction": 0.99},
            "split: expected samples of class 0 on both sides of its 10",
        ),
        (
            {"kind": "grouped", "groups": LABELS},
            "groups of class 0 of which .* found 1",
        ),
        ({"labels": LABELS / 1}, "labels: expected integers"),
    ],
)
def test_arguments_that_make_no_sense_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        split(**{"labels": LABELS, **settings})


# Leave one group out ------------------------------------------------------------------------------


def test_the_draws_hold_out_every_group_of_every_class_once():
    """Two classes of three groups and one of two, whose numbers they share."""
    groups = np.array([0, 0, 1, 1, 2, 2] * 2 + [0, 0, 1, 1])
    labels = np.repeat([0, 1, 2], [6, 6, 4])
    held = []
    for draw in range(3):
        parts = leave_group_out(labels, groups, draw, seed=5)
        assert sorted(np.concatenate(parts)) == list(range(16))
        train, test = (
            {*zip(labels[part], groups[part], strict=True)} for part in parts
        )
        assert not train & test
        assert sorted(label for label, _ in test) == [0, 1, 2]
        held += test
    assert {*held} == {*zip(labels, groups, strict=True)}


def test_classes_draw_their_groups_apart():
    labels, groups = np.repeat(np.arange(8), 6), np.tile(np.arange(6), 8)
    _, test = leave_group_out(labels, groups)
    assert len(set(groups[test].tolist())) > 1
    with pytest.raises(ValueError, match=r"split\.group: expected two .* of class 1"):
        leave_group_out(np.array([0, 0, 1]), np.array([0, 1, 0]))
