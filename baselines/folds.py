"""Folds of training frames: whole groups, else whole sessions, else frames at random."""

from __future__ import annotations

from typing import Any

import numpy as np

FOLDS = 5
Fold = tuple[np.ndarray, np.ndarray]
"""Indices of frames to learn and to test."""


def folds(
    labels: np.ndarray,
    rows: np.ndarray,
    most: int = FOLDS,
    group: np.ndarray | None = None,
    session: np.ndarray | None = None,
) -> tuple[list[Fold], str]:
    """At most `most` folds of the training frames `rows`, and how they were made.

    Folds are of whole groups where they are known; else of whole sessions, if there are two or more
    and each class is in two or more folds; else at random, with every class in each fold. There are
    no folds of fewer than four frames, where a class has a single frame, or where every group is
    the only one of its class.
    """
    if group is not None:
        return _folds_of_units(labels, rows, group, most), "by group"
    if session is not None:
        by_session = _folds_of_units(labels, rows, session, most)
        if by_session:
            return by_session, "by session"
    rng = np.random.default_rng(0)
    known = labels[rows]
    count = min(most, int(np.unique(known, return_counts=True)[1].min()))
    if count < 2 or len(rows) < 4:
        return [], "at random"
    # Dealt out class by class without starting anew, so that folds are of one size.
    shuffled = rng.permutation(len(rows))
    dealt = shuffled[np.argsort(known[shuffled], kind="stable")]
    place = np.empty(len(rows), np.int64)
    place[dealt] = np.arange(len(rows)) % count
    return [_fold(rows, place == k) for k in range(count)], "at random"


def _folds_of_units(
    labels: np.ndarray, rows: np.ndarray, units: np.ndarray, most: int
) -> list[Fold]:
    """Folds of whole units [N], sessions or groups: consecutive ones, or, where a fold would have
    all frames of a class, the units of each class dealt out one by one."""
    unit = units[rows]
    known = np.unique(unit)
    if len(known) < 2:
        return []
    count = min(most, len(known))
    in_order = np.array_split(known, count)
    dealt = _dealt(unit, labels[rows], count)
    classes = set(labels[rows])
    for groups in (in_order, dealt):
        found = [_fold(rows, np.isin(unit, group)) for group in groups]
        if all(_learns(labels, train, classes) for train, _ in found):
            return found
    return []


def _dealt(unit: np.ndarray, labels: np.ndarray, count: int) -> list[list[Any]]:
    """Units dealt out class by class, so that the units of a fold are of several classes."""
    by_class = [np.unique(unit[labels == label]) for label in np.unique(labels)]
    order = list(dict.fromkeys(np.concatenate(by_class).tolist()))
    return [order[k::count] for k in range(count)]


def _learns(labels: np.ndarray, train: np.ndarray, classes: set[int]) -> bool:
    """Whether training frames have two samples and every class."""
    return len(train) >= 2 and set(labels[train]) == classes


def _fold(rows: np.ndarray, tested: np.ndarray) -> Fold:
    return rows[~tested], rows[tested]
