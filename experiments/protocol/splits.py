"""Which samples of a scene train and which test."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import msgspec
import numpy as np

from experiments.protocol.settings import Split
from scenes.frames import Scene
from scenes.split import (
    KINDS,
    by_session,
    learning_curve_subset,
    leave_group_out,
    neighbours_leak,
    sessions_by_name,
    split,
)

# Share of test frames beside a training frame, above which a user is warned.
_LEAK = 0.5


def choose(
    scene: Scene,
    wanted: Split,
    seed: int,
    draw: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Training and test indices, int64, as ``split`` of a config says.

    Which groups test by ``leave_group_out`` goes by the number of the draw.

    Warns:
        UserWarning: if most test frames of a recording stand next to a training frame of their
            class, of which they are nearly copies; if a class that is tested has no training frame.

    Raises:
        ValueError: naming the key of a value that does not fit.
    """
    kinds, kind = (*KINDS, "grouped", "leave_group_out", "session"), wanted.kind
    if kind not in kinds:
        expected = ", ".join(kinds)
        raise ValueError(f"split.kind: expected one of {expected}, found {kind!r}")
    if kind == "session":
        train, test = _across_sessions(scene, wanted, seed)
    else:
        train, test = _within_first_session(scene, wanted, seed, draw)
    if scene.origin == "recorded" and kind == "random":
        _warn_of_neighbours(scene, train, test)
    _warn_of_untrained(scene, kind, train, test)
    n = wanted.n_train
    if n is None:
        return train, test
    return learning_curve_subset(train, scene.labels, n, seed), test


def resample_split(
    scene: Scene,
    wanted: Split,
    seed: tuple[int, int],
    most_test: int,
) -> tuple[np.ndarray, np.ndarray]:
    """(pool, test) of one resample: samples that may train, and at most `most_test` that test.

    Args:
        scene: of the samples.
        wanted: the split; all of its training samples are in the pool.
        seed: of the scene, and number of the resample.
        most_test: test samples are a random subset of so many.
    """
    random = np.random.default_rng(seed)
    of_resample = int(random.integers(2**31))
    # The draws of this kind go through the groups in one order.
    of_split = seed[0] if wanted.kind == "leave_group_out" else of_resample
    whole = msgspec.structs.replace(wanted, n_train=None)
    # A random split of a recording leaks on purpose.
    with warnings.catch_warnings(action="ignore"):
        pool, test = choose(scene, whole, of_split, seed[1])
    if len(test) > most_test:
        shuffled = np.random.default_rng(of_resample).permutation(test)
        test = np.sort(shuffled[:most_test])
    return pool, test


def nested(
    pool: np.ndarray,
    labels: np.ndarray,
    sizes: Sequence[int],
    seed: tuple[int, int],
) -> tuple[list[np.ndarray], list[int]]:
    """Samples of each class in random order, and the sizes that every class can fill.

    Args:
        pool: indices of samples.
        labels: classes of all samples, by index.
        sizes: samples of a class.
        seed: as of :func:`resample_split`; another stream of it than the split has.
    """
    random = np.random.default_rng((*seed, 1))
    shuffled = random.permutation(pool)
    class_of = labels[shuffled]
    order = [shuffled[class_of == c] for c in np.unique(class_of)]
    least = min(map(len, order))
    return order, [n for n in sizes if n <= least]


def _sessions(scene: Scene) -> np.ndarray:
    """Session of each sample, int64 [N]."""
    return scene.samples.get("session", np.zeros(len(scene.labels), np.int64))


def _across_sessions(
    scene: Scene, wanted: Split, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Training samples of the first session, as a random split has them; the last one tests.

    Where sessions are named train, val and test, the names say which of them train and test.

    Warns:
        UserWarning: of sessions that are not used.

    Raises:
        ValueError: more than half of the samples are of sessions that are not used.
    """
    names = scene.samples.get("session_name")
    named = None if names is None else sessions_by_name(np.unique(names).tolist())
    if names is None or named is None:
        first, test = by_session(_sessions(scene))
    else:
        first, test = (np.flatnonzero(np.isin(names, each)) for each in named)
        _tell_unused(names, named)
    labels = scene.labels[first]
    train, _ = split(labels, test_fraction=wanted.test_fraction, seed=seed)
    return first[train], test


def _tell_unused(names: np.ndarray, named: tuple[list[str], list[str]]) -> None:
    train, test = named
    unused = names[~np.isin(names, [*train, *test])]
    if not len(unused):
        return
    others = ", ".join(np.unique(unused))
    text = (
        f"split.kind=session: {', '.join(train)} trains, {', '.join(test)} tests, "
        f"{others} ({len(unused)} of {len(names)} frames) is not used"
    )
    if 2 * len(unused) > len(names):
        raise ValueError(
            f"{text}: expected at most half; move what shall train into the session {train[0]}"
        )
    warnings.warn(text, stacklevel=4)


def _within_first_session(
    scene: Scene, wanted: Split, seed: int, draw: int
) -> tuple[np.ndarray, np.ndarray]:
    """A scene of several sessions trains and tests within the first, unless the split crosses
    them."""
    kind, group = wanted.kind, wanted.group
    by_group = kind in ("grouped", "leave_group_out")
    if by_group and group not in scene.samples:
        expected = ", ".join(scene.samples)
        raise ValueError(f"split.group: expected one of {expected}, found {group!r}")
    sessions = _sessions(scene)
    first = np.flatnonzero(sessions == sessions.min())
    labels = scene.labels[first]
    groups = scene.samples[group or ""][first] if by_group else None
    if kind == "leave_group_out" and groups is not None:
        train, test = leave_group_out(labels, groups, draw, seed)
    else:
        train, test = split(
            labels,
            test_fraction=wanted.test_fraction,
            kind=kind,
            seed=seed,
            order=scene.samples["order"][first],
            groups=groups,
        )
    return first[train], first[test]


def _warn_of_neighbours(
    scene: Scene,
    train: np.ndarray,
    test: np.ndarray,
) -> None:
    order = scene.samples["order"]
    leak = neighbours_leak(scene.labels, order, train, test, _sessions(scene))
    if leak > _LEAK:
        warnings.warn(
            f"split.kind=random: {100 * leak:.0f} % of the test frames stand next to a training "
            "frame of their class in time, of which they may be copies; split.kind=ordered tests "
            "on later ones",
            stacklevel=3,
        )


def _warn_of_untrained(
    scene: Scene, kind: str, train: np.ndarray, test: np.ndarray
) -> None:
    """Warn of classes that are tested only: no model can predict them."""
    labels = scene.labels
    only_tested = np.setdiff1d(labels[test], labels[train])
    if len(only_tested):
        names = ", ".join(str(scene.classes[label]) for label in only_tested)
        n = int(np.isin(labels[test], only_tested).sum())
        warnings.warn(
            f"split.kind={kind}: no training frame of {names}: every model has the "
            f"{n} test frames of them wrong",
            stacklevel=3,
        )
