"""The errors of models on frames that they have not learnt, and the test of a gain."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hdc.command.source import truth_of
from hdc.command.splits import Split
from hdc.readers import Recording

Losses = dict[str, list[np.ndarray]]
"""The losses [Q] in each test, by the name of the model; see :meth:`Data.loss`."""
FLIPS = 9_999
"""Random signs of the units, for the test of a gain."""


@dataclass(frozen=True)
class Data:
    """Frames of one recording or two, in memory.

    Attributes:
        frames: [N, D].
        truth: names of the classes [N], or values [N, T].
        splits: folds of the first recording; and one that learns it and tests the second.
        tested: indices of the frames of each recording, by the words for its test.
    """

    frames: np.ndarray
    truth: np.ndarray
    splits: Sequence[Split]
    tested: Mapping[str, np.ndarray]

    def loss(self, errors: np.ndarray) -> np.ndarray:
        """The loss [Q] of errors [Q, T]: 1 for a wrong label; of values the mean of their errors,
        each divided by the mean error of always answering the median of the first recording."""
        if self.truth.ndim == 1:
            return errors[:, 0]
        first, *_ = self.tested.values()
        values = self.truth[first]
        scale = np.abs(values - np.median(values, axis=0)).mean(axis=0)
        return (errors / np.where(scale > 0, scale, 1)).mean(axis=1)


def prepared(recordings: Mapping[str, Recording], folds: Sequence[Split]) -> Data:
    """One recording or two, by the words for their tests, and the folds of the first."""
    opened = recordings.values()
    truth = np.concatenate([truth_of(one) for one in opened])
    first, *_ = opened
    parts = np.split(np.arange(len(truth)), [len(first)])[: len(opened)]
    return Data(
        np.concatenate([one[:].reshape(len(one), -1) for one in opened]),
        truth,
        [*folds, (parts[0], parts[1])] if len(opened) > 1 else folds,
        dict(zip(recordings, parts, strict=True)),
    )


def errors(model: Any, data: Data) -> tuple[dict[str, np.ndarray], float, float]:
    """Errors of a model in each test; and medians over the splits of the seconds to learn and the
    milliseconds to answer a frame.

    The errors are the absolute error of each value [Q, T]; of classes [Q, 1], 1 for a wrong label.

    Raises:
        ValueError: the model refuses the frames.
    """
    from sklearn.base import clone

    answers, times = data.truth.copy(), []
    for train, tested in data.splits:
        start = time.perf_counter()
        trained = clone(model).fit(data.frames[train], data.truth[train])
        learnt = time.perf_counter()
        found = trained.predict(data.frames[tested])
        frame_s = (time.perf_counter() - learnt) / len(tested)
        times.append((learnt - start, 1000 * frame_s))
        answers[tested] = found.reshape(answers[tested].shape)
    if data.truth.ndim == 1:
        wrong = (answers != data.truth).astype(float)[:, None]
    else:
        wrong = np.abs(answers - data.truth)
    return {test: wrong[rows] for test, rows in data.tested.items()}, *np.median(
        times, axis=0
    )


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
