"""Which samples train and which test: index arrays, seeded, and the same on every machine.

Every function is a pure function of its arguments; the indices it returns are int64, in increasing
order for test sets and in random order for training sets, so that a model that learns as it reads
does not see one class after the other (in time order, where a split by time is asked for).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenes.validate import is_integer, is_number, require, require_integer

KINDS = ("random", "ordered")
"""Kinds of split that every scene can have; ``"grouped"`` needs groups besides."""


def split(
    labels: np.ndarray,
    *,
    test_fraction: float | None = None,
    n_test: int | None = None,
    kind: str = "random",
    seed: int = 0,
    order: np.ndarray | None = None,
    groups: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Training and test indices, stratified: each class is split in the same proportion.

    Args:
        labels: int64 [N].
        test_fraction: share of the samples to test on, in (0, 1); 0.2 if ``n_test`` is not given.
        n_test: their number instead. What the classes' proportions leave over goes to the classes
            with the largest remainders, ties to the lowest label.
        kind: ``"random"``; ``"ordered"``: the last samples in time of each class test, so the
            model is asked about what came after everything it has learnt of that class; or
            ``"grouped"``: samples of one group are never on both sides, so the model is asked about
            groups it has not seen. Groups are drawn in random order; one tests if that brings the
            test samples of the classes nearer to their proportions.
        seed: seed of the random choice, and of the order of the training indices.
        order: place in time of each sample [N], for ``"ordered"``; ``scene.samples["order"]``.
        groups: group of each sample [N], numbers or strings, for ``"grouped"``: what neighbouring
            samples share, for example the actuator position of the fibre
            (``scene.samples["depth"]``) or the session (``scene.samples["session"]``).

    Returns:
        train [N − n_test], test [n_test]. For ``"grouped"`` the number of test samples is as near
        to n_test as whole groups allow.

    Raises:
        ValueError: an argument is out of range, or some class would be left without a training or
            a test sample.
    """
    classes, class_of, counts = _classes(labels)
    n = len(class_of)
    n_test = _n_test(n, test_fraction, n_test)
    kinds = (*KINDS, "grouped")
    require(kind in kinds, "split.kind", kind, f"one of {', '.join(kinds)}")
    for name, values, needed in (("order", order, "ordered"), ("groups", groups, "grouped")):
        if kind == needed and np.asarray(values).shape != (n,):
            found = "none" if values is None else f"shape {np.asarray(values).shape}"
            raise ValueError(
                f"split.{name}: expected shape ({n},), a value each sample, for split.kind={kind}, "
                f"found {found}"
            )
    tested = _apportion(n_test, counts)
    for c, name in enumerate(classes):
        if not 0 < tested[c] < counts[c]:
            raise ValueError(
                f"split: class {name} has {counts[c]} samples, of which {tested[c]} would test; "
                f"expected at least one to train and one to test"
            )

    rng = _generator(seed)
    if kind == "grouped":
        test = _of_whole_groups(classes, class_of, tested, np.asarray(groups), rng)
        train = rng.permutation(n)
        return train[~np.isin(train, test)], test
    rank = rng.permutation(n) if kind == "random" else np.asarray(order)
    members = _by_class(class_of, rank, len(classes))
    train = np.concatenate([m[: len(m) - t] for m, t in zip(members, tested, strict=True)])
    test = np.concatenate([m[len(m) - t :] for m, t in zip(members, tested, strict=True)])
    train = train[np.argsort(rank[train], kind="stable")]
    return train, np.sort(test)


def neighbours_leak(
    labels: np.ndarray, order: np.ndarray, train: np.ndarray, test: np.ndarray
) -> float:
    """Share of the test samples next to which, in time, a training sample of their class lies.

    Neighbouring frames of one touch are nearly copies. Near 1, a test of recorded frames says how
    well a model remembers, and ``"ordered"`` or ``"grouped"`` is the split to take; independent
    samples in any order of L classes come to 2/L or less.

    Args:
        labels: int64 [N].
        order: place in time of each sample [N]; ``scene.samples["order"]``.
        train, test: indices that :func:`split` gave.
    """
    _, class_of, _ = _classes(labels)
    in_time = np.argsort(order, kind="stable")
    place = np.empty_like(in_time)
    place[in_time] = np.arange(1, len(in_time) + 1)
    trained = np.full(
        len(in_time) + 2, -1
    )  # by place: class of a training sample; none at the ends
    trained[place[train]] = class_of[train]
    before, after = trained[place[test] - 1], trained[place[test] + 1]
    return float(((before == class_of[test]) | (after == class_of[test])).mean())


def learning_curve_subsets(
    train: np.ndarray, labels: np.ndarray, sizes: Sequence[int], seed: int = 0
) -> dict[int, np.ndarray]:
    """For each size n, n of the training indices: stratified, and nested in every larger subset.

    The training samples are put in one fixed order, in which every beginning is as close to the
    classes' proportions as whole samples allow and the first L hold each class once; a subset is
    the first n.

    Args:
        train: training indices [M].
        labels: int64 [N], of all samples.
        sizes: each in [L, M], where L is the number of classes among the training samples.
        seed: of the choice within each class.

    Returns:
        {n: indices [n]} in increasing n.

    Raises:
        ValueError: a size is out of range or not an integer.
    """
    train = np.asarray(train)
    classes, class_of, _ = _classes(np.asarray(labels)[train])
    for size in sizes:
        require(
            is_integer(size) and len(classes) <= size <= len(train),
            "split.sizes",
            size,
            f"integers from {len(classes)} (one sample a class) to {len(train)} "
            "(all training samples)",
        )
    rank = _generator(seed).permutation(len(train))
    members = _by_class(class_of, rank, len(classes))
    # The k-th sample of a class of n is due at the share (k + 1/2)/n of the whole; the first of
    # each class is due at once.
    due = np.empty(len(train))
    for m in members:
        due[m] = (np.arange(len(m)) + 0.5) / len(m)
        due[m[0]] = -1.0
    ordered = train[np.lexsort((rank, due))]
    return {int(size): ordered[: int(size)] for size in sorted(set(sizes))}


def by_session(
    sessions: np.ndarray, train: object = 0, test: object = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the samples of one session and of another: what was learnt then, asked now.

    Args:
        sessions: session of each sample [N]; ``scene.samples["session"]``.
        train, test: the sessions to train and to test on; different, both present.
    """
    sessions = np.asarray(sessions)
    if train == test:
        same = "the same"
        if len(np.unique(sessions)) == 1:
            same += (
                " as all are of one session (recordings state them in a column session of "
                "manifest.csv, or in an array session of the .npz)"
            )
        raise ValueError(f"split.test: expected a session other than {train!r}, found {same}")
    chosen = [np.flatnonzero(sessions == s) for s in (train, test)]
    for key, session, found in zip(("train", "test"), (train, test), chosen, strict=True):
        if not len(found):
            raise ValueError(
                f"split.{key}: expected one of the sessions {np.unique(sessions).tolist()}, "
                f"found {session!r}"
            )
    return chosen[0], chosen[1]


def _classes(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Labels there are [L], which of them each sample has [N], samples of each [L]."""
    labels = np.asarray(labels)
    if labels.ndim != 1 or labels.dtype.kind not in "iu":
        raise ValueError(
            f"labels: expected integers of shape [N], found {labels.dtype} {labels.shape}"
        )
    if not len(labels):
        raise ValueError("labels: expected at least one sample, found none")
    return np.unique(labels, return_inverse=True, return_counts=True)


def _n_test(n: int, test_fraction: float | None, n_test: int | None) -> int:
    if n_test is None:
        fraction = 0.2 if test_fraction is None else test_fraction
        inside = is_number(fraction) and 0 < fraction < 1
        require(inside, "split.test_fraction", fraction, "a number in (0, 1)")
        return round(n * float(fraction))
    if test_fraction is not None:
        raise ValueError(
            f"split: expected n_test or test_fraction, found both ({n_test}, {test_fraction})"
        )
    require_integer("split.n_test", n_test, 1, n - 1)
    return int(n_test)


def _apportion(n: int, counts: np.ndarray) -> np.ndarray:
    """n samples over classes in proportion to counts [L] (largest remainders, exact integers)."""
    share, remainder = np.divmod(n * counts, counts.sum())
    share[np.argsort(-remainder, kind="stable")[: n - share.sum()]] += 1
    return share


def _of_whole_groups(
    classes: np.ndarray,
    class_of: np.ndarray,
    target: np.ndarray,
    groups: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Test indices, increasing: of whole groups, near ``target`` [L] samples of each class.

    Every class keeps a group to train on and one to test on.
    """
    names, group_of = np.unique(groups, return_inverse=True)
    held = np.zeros((len(names), len(classes)), np.int64)  # samples of each class in each group
    np.add.at(held, (group_of, class_of), 1)
    counts, missing = held.sum(0), target.copy()
    chosen = np.zeros(len(names), bool)
    drawn = rng.permutation(len(names)).tolist()

    def can_test(g: int) -> bool:
        left = counts - target + missing - held[g]
        return not chosen[g] and bool(((left > 0) | (held[g] == 0)).all())

    for g in drawn:
        nearer = np.abs(missing - held[g]).sum() < np.abs(missing).sum()
        if nearer and can_test(g):
            chosen[g] = True
            missing -= held[g]
    for c, name in enumerate(classes):
        if missing[c] == target[c]:  # its groups are larger than what should test
            possible = [g for g in drawn if held[g, c] and can_test(g)]
            if not possible:
                raise ValueError(
                    f"split.groups: expected groups of class {name} of which some test and some "
                    f"train, found {np.count_nonzero(held[:, c])}"
                )
            smallest = min(possible, key=lambda g: held[g].sum())
            chosen[smallest] = True
            missing -= held[smallest]
    return np.flatnonzero(chosen[group_of])


def _by_class(class_of: np.ndarray, rank: np.ndarray, n_classes: int) -> list[np.ndarray]:
    """Indices of each class, in increasing rank."""
    by_rank = np.argsort(rank, kind="stable")
    return [by_rank[class_of[by_rank] == c] for c in range(n_classes)]


def _generator(seed: int) -> np.random.Generator:
    require_integer("split.seed", seed, 0)
    return np.random.default_rng(seed)
