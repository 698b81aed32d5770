"""Training and test indices: pure functions of labels and seed, the same on every machine.

Test indices increase. Training indices are in random order, so that a model that learns frame by
frame does not see one class after the other; a split by time keeps the order of time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdc.parameters import check_integer
from scenes.validate import require

KINDS = ("random", "ordered")
"""Kinds of splits that need no groups; ``"grouped"`` does."""


def split(
    labels: np.ndarray,
    *,
    test_fraction: float = 0.2,
    kind: str = "random",
    seed: int = 0,
    order: np.ndarray | None = None,
    groups: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Split the samples in two, each class in the same proportion.

    Args:
        labels: int64 [N].
        test_fraction: share of the samples to test on, in (0, 1). Rounding is by largest
            remainder, and ties go to the lowest label.
        kind: ``"random"``; ``"ordered"``: the last samples in time of each class test; or
            ``"grouped"``: no group has samples on both sides. Groups are taken in random
            order, and a group tests if it brings the test samples nearer to the proportions of the
            classes.
        seed: seed of the random choice, and of the order of the training indices.
        order: place in time of each sample [N], for ``"ordered"``.
        groups: group of each sample [N], numbers or strings, for ``"grouped"``.

    Returns:
        train, test: indices. With ``"grouped"``, their numbers are as near as whole groups allow.

    Raises:
        ValueError: an argument is out of range, or a class would have no training or test sample.
    """
    classes, class_of, counts = _classes(labels)
    n = len(class_of)
    inside = 0 < test_fraction < 1
    require(inside, "split.test_fraction", test_fraction, "a number in (0, 1)")
    n_test = round(n * float(test_fraction))
    # In proportion to the counts: largest remainders, in exact integers.
    target, remainder = np.divmod(n_test * counts, n)
    left = n_test - target.sum()
    largest = np.argsort(-remainder, kind="stable")
    target[largest[:left]] += 1
    for name, share, count in zip(classes, target, counts, strict=True):
        expected = f"samples of class {name} on both sides of its {count}"
        require(0 < share < count, "split", f"{share} to test", expected)

    rng = np.random.default_rng(seed)
    if kind == "grouped":
        test = _of_whole_groups(classes, class_of, target, np.asarray(groups), rng)
        train = rng.permutation(n)
        return train[~np.isin(train, test)], test
    rank = rng.permutation(n) if kind == "random" else np.asarray(order)
    trained, tested = [], []
    for members, n_last in zip(
        _by_class(class_of, rank, len(classes)), target, strict=True
    ):
        first, last = np.split(members, [len(members) - n_last])
        trained.append(first)
        tested.append(last)
    train = np.concatenate(trained)
    in_order = np.argsort(rank[train], kind="stable")
    return train[in_order], np.sort(np.concatenate(tested))


def leave_group_out(
    labels: np.ndarray, groups: np.ndarray, draw: int = 0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Training and test indices: one group of each class tests, all others train.

    Every class draws for itself: draw k takes the k-th group in a random order of the class's
    groups, and starts again after the last one. A group that has samples of two classes may
    therefore train one of them and test the other.

    Args:
        labels: int64 [N].
        groups: group of each sample [N], numbers or strings.
        draw: number of the draw, from 0; as many draws as a class has groups test each group once.
        seed: of the orders, and of the order of the training indices.

    Raises:
        ValueError: a class has a single group, and no sample to train on without it.
    """
    classes, class_of, _ = _classes(labels)
    rng = np.random.default_rng(seed)
    tested = np.zeros(len(class_of), bool)
    for c, name in enumerate(classes):
        members = class_of == c
        names = rng.permutation(np.unique(np.asarray(groups)[members]))
        expected = f"two or more groups of class {name}"
        require(len(names) > 1, "split.group", f"{len(names)}", expected)
        tested |= members & (groups == names[draw % len(names)])
    return rng.permutation(np.flatnonzero(~tested)), np.flatnonzero(tested)


def neighbours_leak(
    labels: np.ndarray,
    order: np.ndarray,
    train: np.ndarray,
    test: np.ndarray,
    session: np.ndarray,
) -> float:
    """Share of the test samples whose neighbour in time is a training sample of the same class.

    Neighbouring frames of one touch are nearly copies, so near 1 a test measures memory. For
    independent samples of L classes the share is 2/L or less.

    Arguments are labels int64 [N], the place in time of each sample [N], indices from :func:`split`
    and the session of each sample [N]: neighbours are of one session, because each session may
    count its times from 0.
    """
    _, class_of, _ = _classes(labels)
    trained = np.full(len(class_of), -1)
    trained[train] = class_of[train]
    in_time = np.lexsort((order, session))
    session, trained, class_of = session[in_time], trained[in_time], class_of[in_time]
    together = session[1:] == session[:-1]
    leaks = np.zeros(len(in_time), bool)
    leaks[1:] |= together & (trained[:-1] == class_of[1:])  # from the one before
    leaks[:-1] |= together & (trained[1:] == class_of[:-1])  # from the one after
    return float(leaks[np.isin(in_time, test)].mean())


def learning_curve_subset(
    train: np.ndarray,
    labels: np.ndarray,
    size: int,
    seed: int = 0,
) -> np.ndarray:
    """So many training indices: stratified, and contained in every larger subset.

    They are the first of one order of all, in which any first n are as near to the proportions of
    the classes as whole samples allow, and the first L have each class once.

    Args:
        train: training indices [M].
        labels: int64 [N], of all samples.
        size: in [L, M], where L is the number of classes among the training samples; where all
            classes have equally many, a multiple of L, because one frame more would favour a class
            in HDC.
        seed: of the choice within each class.

    Raises:
        ValueError: the size is not as above.
    """
    classes, class_of, counts = _classes(labels[train])
    low, high = len(classes), len(train)
    check_integer("split.n_train", size, low, high)  # one of each class, all
    less = size // low * low
    fair = f"a multiple of the {low} classes, such as {less} or {less + low}"
    alike = bool((counts == counts[0]).all())
    require(not alike or size == less, "split.n_train", size, fair)
    rank = np.random.default_rng(seed).permutation(len(train))
    # The k-th sample of a class of n is due at the share (k + 1/2)/n of the whole; the first of
    # each class is due at once.
    due = np.empty(len(train))
    for members in _by_class(class_of, rank, len(classes)):
        count = len(members)
        due[members] = (np.arange(count) + 0.5) / count
        due[members[0]] = -1.0
    return train[np.lexsort((rank, due))[:size]]


TRAIN, VALIDATION, TEST = (
    ("train", "training"),
    ("val", "valid", "validation"),
    ("test", "testing"),
)
"""Names of sessions that say what their frames are for."""


def sessions_by_name(names: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """The training and the test sessions by their names; None where the names do not say.

    ``test`` tests if there is one, otherwise ``val``; frames of ``val`` never train.
    """
    lower = {name: name.lower() for name in names}
    train = [name for name, known in lower.items() if known in TRAIN]
    for kind in (TEST, VALIDATION):
        test = [name for name, known in lower.items() if known in kind]
        if train and test:
            return train, test
    return None


def by_session(sessions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the samples of the first session and of the last, from the session of each [N].

    Raises:
        ValueError: there is one session only.
    """
    first, last = sessions.min(), sessions.max()
    require(first != last, "scene", 1, "two or more sessions")
    return np.flatnonzero(sessions == first), np.flatnonzero(sessions == last)


def _classes(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The labels that occur [L], the index of each sample's label [N], and the counts [L]."""
    labels = np.asarray(labels)
    integers = labels.ndim == 1 and labels.dtype.kind in "iu"
    found = f"{labels.dtype} {labels.shape}"
    expected = "integers of shape [N], N ≥ 1"
    require(integers and len(labels) > 0, "labels", found, expected)
    return np.unique(labels, return_inverse=True, return_counts=True)


def _of_whole_groups(
    classes: np.ndarray,
    class_of: np.ndarray,
    target: np.ndarray,
    groups: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Test indices: whole groups, near ``target`` [L]; each class keeps a group on both sides."""
    names, group_of = np.unique(groups, return_inverse=True)
    # Samples of each class in each group.
    held = np.zeros((len(names), len(classes)), np.int64)
    np.add.at(held, (group_of, class_of), 1)
    counts, missing = held.sum(0), target.copy()
    chosen = np.zeros(len(names), bool)
    drawn = rng.permutation(len(names)).tolist()

    def can_test(g: int) -> bool:
        """Whether every class of the group has training samples without it."""
        if chosen[g]:
            return False
        left = counts - target + missing - held[g]
        inside = held[g] > 0
        return bool((left[inside] > 0).all())

    for g in drawn:
        error = np.abs(missing).sum()
        error_with = np.abs(missing - held[g]).sum()
        if error_with < error and can_test(g):
            chosen[g] = True
            missing -= held[g]
    for c, name in enumerate(classes):
        if missing[c] == target[c]:  # each of its groups is larger than the test set
            possible = [g for g in drawn if held[g, c] and can_test(g)]
            found = int(np.count_nonzero(held[:, c]))
            expected = f"groups of class {name} of which some test and some train"
            require(bool(possible), "split.groups", found, expected)
            smallest = min(possible, key=lambda g: held[g].sum())
            chosen[smallest] = True
            missing -= held[smallest]
    return np.flatnonzero(chosen[group_of])


def _by_class(
    class_of: np.ndarray, rank: np.ndarray, n_classes: int
) -> list[np.ndarray]:
    """Indices of each class, in increasing rank."""
    by_rank = np.argsort(rank, kind="stable")
    return [by_rank[class_of[by_rank] == c] for c in range(n_classes)]
