"""Re-referencing: updates that need new frames and no labels of them.

Frames are standardised and a reference frame is subtracted from each (:class:`hdc.encoders.
Reference`): of the training, the mean of its frames. After the drift another reference is
subtracted from the queries, and nothing else changes. The ``method`` is one of:

- ``zeroed``: the mean of N_new frames of the second session, with all classes alike, or with a
  ``share`` of them of one class.
- ``untouched``: the mean of N_new frames of the class in which nobody touches; the reference of the
  training is then the mean of such frames of the first session.

Every mean is of standardised frames. HDC does it by the reference of its encoder and its own
``rezero``, a baseline by ``predict_zeroed``: the same frames, alike.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from baselines.bank import Bank
from hdc import HDCClassifier

Choice = tuple[int, float | None, np.ndarray]  # n, share of one class, frames


def unlabelled(
    pool: np.ndarray,
    labels: np.ndarray,
    sizes: Iterable[tuple[int, float | None]],
    favoured: int,
    n_classes: int,
) -> Iterator[Choice]:
    """Unlabelled frames of each size that the pool can fill, its first in time.

    Args:
        pool: indices of frames, in order of time.
        labels: classes of all frames, by index.
        sizes: numbers of frames, and the share of one class among them; None: all classes alike.
        favoured: which class has the share, modulo the number of classes.
        n_classes: L.
    """
    for n, share in sizes:
        if share is None:
            counts = _evenly(n, n_classes)
        else:
            others = _evenly(n - round(share * n), n_classes - 1)
            counts = np.insert(others, favoured % n_classes, round(share * n))
        chosen = first_of_each(pool, labels, counts)
        if chosen is not None:
            yield n, share, chosen


def _evenly(n: int, n_classes: int) -> np.ndarray:
    """n as L numbers, the first of which may be larger by one."""
    return (n + np.arange(n_classes)[::-1]) // n_classes


def first_of_each(
    pool: np.ndarray, labels: np.ndarray, counts: np.ndarray
) -> np.ndarray | None:
    """The first of the pool of each class, as many as counts [L] say; None where there are less."""
    of_classes = [pool[labels[pool] == label] for label in range(len(counts))]
    if any(len(of) < n for of, n in zip(of_classes, counts, strict=True)):
        return None
    return np.concatenate([of[:n] for of, n in zip(of_classes, counts, strict=True)])


def rezeroed(
    model: Any,
    bank: Bank,
    train: np.ndarray,
    asked: np.ndarray,
    before: np.ndarray,
    afters: Iterable[np.ndarray | None],
) -> Iterator[np.ndarray]:
    """Labels of the frames asked, by a model of training frames minus the mean of those `before`;
    from the frames asked the mean of each of `afters` is subtracted, or (None) the same."""
    if not isinstance(model, HDCClassifier):
        for after in afters:
            reference = before if after is None else after
            yield model.predict_zeroed(bank, train, asked, before, reference)
        return
    stored = model.unlearned()
    if not np.array_equal(before, train):
        stored.set_params(encoder__frame=bank.at(before)[:].numpy(force=True))
    stored.fit(bank.at(train), bank.labels[train])
    for after in afters:
        updated = copy.deepcopy(stored)
        if after is not None:
            with warnings.catch_warnings():
                # What frames of one class do to a model is measured here; a single frame minus
                # itself is constant.
                warnings.filterwarnings("ignore", message="rezero:|.*constant frame")
                updated.rezero(bank.at(after))
        yield updated.predict(bank.at(asked))
