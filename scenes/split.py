"""Which samples train and which test: index arrays, seeded, and the same on every machine.

Every function is a pure function of its arguments; the indices it returns are int64, in increasing
order for test sets and in random order for training sets, so that a model that learns as it reads
does not see one class after the other (in time order, where a split by time is asked for).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

KINDS = ("random", "ordered")


def split(
    labels: np.ndarray,
    *,
    test_fraction: float | None = None,
    n_test: int | None = None,
    kind: str = "random",
    seed: int = 0,
    order: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Training and test indices, stratified: each class is split in the same proportion.

    Args:
        labels: int64 [N].
        test_fraction: share of the samples to test on, in (0, 1); 0.2 if ``n_test`` is not given.
        n_test: their number instead. What the classes' proportions leave over goes to the classes
            with the largest remainders, ties to the lowest label.
        kind: ``"random"``, or ``"ordered"``: the last samples in time of each class test, so the
            model is asked about what came after everything it has learnt of that class.
        seed: of the random choice, and of the order of the training indices (random split).
        order: place in time of each sample [N], for ``"ordered"``; ``scene.samples["order"]``.

    Returns:
        train [N − n_test], test [n_test].

    Raises:
        ValueError: an argument is out of range, or some class would be left without a training or
            a test sample.
    """
    classes, class_of, counts = _classes(labels)
    n = len(class_of)
    n_test = _n_test(n, test_fraction, n_test)
    if kind not in KINDS:
        raise ValueError(f"split.kind: expected one of {', '.join(KINDS)}, found {kind!r}")
    if kind == "ordered":
        if order is None:
            raise ValueError("split.order: an ordered split needs each sample's place in time")
        if np.shape(order) != (n,):
            raise ValueError(f"split.order: expected shape ({n},), found {np.shape(order)}")
    tested = _apportion(n_test, counts)
    for c, name in enumerate(classes):
        if not 0 < tested[c] < counts[c]:
            raise ValueError(
                f"split: class {name} has {counts[c]} samples, of which {tested[c]} would test; "
                f"expected at least one to train and one to test"
            )

    rng = _generator(seed)
    rank = rng.permutation(n) if kind == "random" else np.asarray(order)
    members = _by_class(class_of, rank, len(classes))
    train = np.concatenate([m[: len(m) - t] for m, t in zip(members, tested, strict=True)])
    test = np.concatenate([m[len(m) - t :] for m, t in zip(members, tested, strict=True)])
    train = train[np.argsort(rank[train], kind="stable")]
    return train, np.sort(test)


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
        if not _is_int(size) or not len(classes) <= size <= len(train):
            raise ValueError(
                f"split.sizes: expected integers from {len(classes)} (one sample a class) to "
                f"{len(train)} (all training samples), found {size!r}"
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
        raise ValueError(f"split.test: expected a session other than {train!r}, found the same")
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
        number = isinstance(fraction, int | float | np.number) and not isinstance(fraction, bool)
        if not number or not 0 < fraction < 1:
            raise ValueError(
                f"split.test_fraction: expected a number in (0, 1), found {fraction!r}"
            )
        return round(n * float(fraction))
    if test_fraction is not None:
        raise ValueError(
            f"split: expected n_test or test_fraction, found both ({n_test}, {test_fraction})"
        )
    if not _is_int(n_test) or not 0 < n_test < n:
        raise ValueError(f"split.n_test: expected an integer in [1, {n - 1}], found {n_test!r}")
    return int(n_test)


def _apportion(n: int, counts: np.ndarray) -> np.ndarray:
    """n samples over classes in proportion to counts [L] (largest remainders, exact integers)."""
    share, remainder = np.divmod(n * counts, counts.sum())
    share[np.argsort(-remainder, kind="stable")[: n - share.sum()]] += 1
    return share


def _by_class(class_of: np.ndarray, rank: np.ndarray, n_classes: int) -> list[np.ndarray]:
    """Indices of each class, in increasing rank."""
    by_rank = np.argsort(rank, kind="stable")
    return [by_rank[class_of[by_rank] == c] for c in range(n_classes)]


def _generator(seed: int) -> np.random.Generator:
    if not _is_int(seed) or seed < 0:
        raise ValueError(f"split.seed: expected an integer ≥ 0, found {seed!r}")
    return np.random.default_rng(seed)


def _is_int(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
