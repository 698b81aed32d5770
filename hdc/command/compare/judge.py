"""The errors of models on frames that they have not learnt, and the test of a gain."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hdc.command.splits import Split

Losses = dict[str, list[np.ndarray]]
"""The losses [Q] in each test, by the name of the model: 1 for a wrong label; of values the mean of
their errors, each divided by its :func:`scale`."""
FLIPS = 9_999
"""Random signs of the units, for the test of a gain."""


class Tested(NamedTuple):
    """A model in a test of Q frames, in their order.

    Attributes:
        errors: absolute errors of the values [Q, T]; of classes [Q, 1], 1 for a wrong label.
        learn_s: seconds to learn, the median over the splits.
        frame_ms: milliseconds to answer a frame, the median over the splits.
    """

    errors: np.ndarray
    learn_s: float
    frame_ms: float


def tested(
    model: Any, frames: np.ndarray, truth: np.ndarray, splits: Sequence[Split]
) -> Tested:
    """Train a model on one side of each split, and test it on the other.

    Args:
        model: untrained.
        frames: [N, D].
        truth: names of the classes [N], or values [N, T].
        splits: of the frames, each of which is tested once or not at all.

    Raises:
        ValueError: the model refuses the frames.
    """
    from sklearn.base import clone

    answers, times = truth.copy(), []
    for train, rows in splits:
        start = time.perf_counter()
        trained = clone(model).fit(frames[train], truth[train])
        learnt = time.perf_counter()
        found = trained.predict(frames[rows])
        frame_s = (time.perf_counter() - learnt) / len(rows)
        times.append((learnt - start, 1000 * frame_s))
        answers[rows] = found.reshape(answers[rows].shape)
    asked = np.sort(np.concatenate([rows for _, rows in splits]))
    if truth.ndim == 1:
        wrong = (answers != truth).astype(float)[:, None]
    else:
        wrong = np.abs(answers - truth)
    return Tested(wrong[asked], *np.median(times, axis=0))


def scale(truth: np.ndarray) -> np.ndarray:
    """Mean error [T] of always answering the median of values [N, T], 1 where all are equal; and 1
    of classes."""
    if truth.ndim == 1:
        return np.ones(1)
    error = np.abs(truth - np.median(truth, axis=0)).mean(axis=0)
    return np.where(error > 0, error, 1)


def p_value(
    mine: str, theirs: str, losses: Mapping[str, np.ndarray], unit: np.ndarray
) -> float:
    """The probability of so large a gain of one model over another by chance.

    Signs of the differences are flipped unit by unit, for frames of a session or a group go
    together. The largest gain of all models counts, so that the choice of the best is no advantage
    (Westfall, Young, Resampling-based multiple testing (1993)).

    Args:
        mine: name of the model that was chosen among the models in `losses`.
        theirs: name of the model that it is compared with.
        losses: of each model [Q].
        unit: number of the session, the group or the frame [Q].
    """
    sums = [np.bincount(unit, losses[theirs] - loss) for loss in losses.values()]
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], (FLIPS, len(sums[0])))
    largest = (signs @ np.transpose(sums)).max(axis=1)
    found = (losses[theirs] - losses[mine]).sum()
    # Sums of the same numbers in another order differ by rounding.
    as_large = largest >= found - 1e-9 * len(unit)
    return float((1 + as_large.sum()) / (1 + FLIPS))
