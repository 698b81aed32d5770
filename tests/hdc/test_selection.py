"""Folds of training frames, whole groups in one of them, and the race of methods in them."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from hdc import selection


def corner(n=60, seed=0):
    """Frames of two classes that differ in four pixels of a hundred, under much noise."""
    rng = np.random.default_rng(seed)
    frames = rng.integers(0, 200, (n, 10, 10)).astype(np.uint8)
    labels = np.arange(n) % 2
    frames[labels == 1, :2, :2] = 255
    return torch.from_numpy(frames), labels


def in_frames(bank):
    return selection.Frames(bank, (), (), bank.groups, None, "numpy")


@pytest.mark.parametrize("nested", [False, True])
def test_frames_of_a_group_are_in_one_fold(nested):
    """Whether groups have frames of every class, or each of one class."""
    frames, labels = corner()
    groups = np.arange(60) // 10
    if nested:
        groups = 2 * groups + labels
    bank = Bank(frames, labels, 2, groups)
    rows = np.arange(3, 60)
    made, how = selection.folds(in_frames(bank), rows)
    assert (len(made), how) == (5, "by session")
    for train, test in made:
        assert not set(groups[train]) & set(groups[test])
        assert set(labels[train]) == {0, 1}
    tested = np.concatenate([test for _, test in made])
    assert sorted(tested) == rows.tolist()
    alone = Bank(frames, labels, 2, labels)  # each class is of one group only
    assert selection.folds(in_frames(alone), rows)[1] == "at random"


@pytest.mark.parametrize(
    ("numbers", "count"), [([2, 2], 2), ([3, 9], 3), ([200, 130, 7], 5)]
)
def test_folds_at_random_are_dealt_class_by_class(numbers, count):
    """As cards, by plain loops from numpy's permutation of seed 0: the same on every machine."""
    labels = np.random.default_rng(1).permutation(
        np.repeat(np.arange(len(numbers)), numbers)
    )
    rows = np.arange(len(labels))[::-1]
    bank = Bank(torch.zeros(len(labels), 1, dtype=torch.uint8), labels, len(numbers))
    shuffled = np.random.default_rng(0).permutation(len(rows)).tolist()
    dealt = sorted(shuffled, key=lambda place: labels[rows[place]])
    made, how = selection.folds(in_frames(bank), rows)
    assert (len(made), how) == (count, "at random")
    for k, (train, test) in enumerate(made):
        own = sorted(dealt[k::count])
        assert test.tolist() == rows[own].tolist()
        assert train.tolist() == np.delete(rows, own).tolist()
        assert set(labels[train]) == set(labels[test]) == set(range(len(numbers)))


@pytest.mark.parametrize("numbers", [[1, 9], [1, 1], [3]])
def test_too_few_frames_make_no_folds(numbers):
    labels = np.repeat(np.arange(len(numbers)), numbers)
    bank = Bank(torch.zeros(len(labels), 1, dtype=torch.uint8), labels, len(numbers))
    made = selection.folds(in_frames(bank), np.arange(len(labels)))
    assert made == ([], "at random")


@dataclass(frozen=True)
class Scripted:
    """Wrong in the first frames of each fold, in so many of one fold after the other; −1 is a
    refusal."""

    name: str
    wrong: tuple[int, ...]

    def answers(self, frames, train, test):
        number = test[0] // 10
        if self.wrong[number] < 0:
            raise ValueError(f"{self.name} refuses fold {number}")
        found = frames.labels[test].copy()
        found[: self.wrong[number]] += 1
        return found


class OfAnotherKind(Scripted):
    pass


def test_a_race_tells_losses_refusals_and_who_was_given_up():
    """Three folds of 4, 10 and 10 frames, by hand; a frame counts once."""
    frames, labels = corner(30)
    data = in_frames(Bank(frames, labels, 2))
    tests = [np.arange(4), np.arange(10, 20), np.arange(20, 30)]
    made = [(np.setdiff1d(np.arange(30), test), test) for test in tests]
    published = Scripted("published", (4, 10, 10))  # far behind, but to the end
    even = Scripted("even", (0, 3, 3))
    behind = Scripted("behind", (4, 0, 0))
    alone = OfAnotherKind("alone", (4, 1, 0))  # the best of its kind
    refused = Scripted("refused", (-1, 0, 0))
    later = Scripted("later", (0, 0, -1))
    best = Scripted("best", (1, 0, 1))
    methods = [published, even, behind, alone, refused, later, best]
    found = selection.Scores()
    assert [*selection.race(methods, data, made, found)] == methods
    assert found.reasons == {
        "refused": "refused refuses fold 0",
        "later": "later refuses fold 2",
    }
    assert found.given_up == ["behind"]
    losses = {published: 1, even: 6 / 24, behind: 1, alone: 5 / 24, best: 2 / 24}
    assert found.losses == pytest.approx(losses)
    assert list(found.losses) == list(losses)
    assert found.best(Scripted) == best
    assert found.best(OfAnotherKind) == alone
    assert found.best(selection.Combination) is None
