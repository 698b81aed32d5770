"""Estimators: one for each kind of quantity, whoever asks for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from experiments.protocol import evaluate
from experiments.records.results import Group, Run

WILSON = "Wilson, test samples of all seeds"
STUDENT = "Student, over seeds"


class Estimate(NamedTuple):
    """A value and its 95 % interval; bounds are NaN where they are not known."""

    value: float
    low: float = math.nan
    high: float = math.nan


def mean_interval(values: Sequence[float]) -> Estimate:
    """Mean and Student's interval of independent values."""
    from scipy.special import stdtrit  # scipy.stats takes as long to import as the rest

    mean, n = float(np.mean(values)), len(values)
    if n < 2:
        return Estimate(mean)
    half = float(stdtrit(n - 1, 0.975) * np.std(values, ddof=1) / math.sqrt(n))
    return Estimate(mean, mean - half, mean + half)


def share(group: Group) -> Estimate:
    """Test accuracy of the samples of all seeds together, with Wilson's interval."""
    right = group.right
    return Estimate(float(right.mean()), *evaluate.wilson(int(right.sum()), len(right)))


def median_time(seconds: Sequence[float]) -> Estimate:
    """Geometric mean of times that spread by factors: an estimate of their median.

    Student's t interval of the mean logarithm; unknown for fewer than three times (the interval of
    two spans decades), or if one is not finite.
    """
    middle = float(np.median(seconds))
    if len(seconds) < 3 or not np.isfinite(seconds).all():
        return Estimate(middle)
    _, low, high = mean_interval(np.log(seconds).tolist())
    return Estimate(middle, math.exp(low), math.exp(high))


def crossing(n: Sequence[float], accuracy: Sequence[float], level: float = 0.9) -> float:
    """N at which a curve first rises above the level, between two N on a line; NaN if it never
    does."""
    order = np.argsort(n)
    x, y = np.asarray(n, float)[order], np.asarray(accuracy, float)[order]
    above = np.flatnonzero(y > level)
    if not len(above):
        return math.nan
    k = int(above[0])
    return float(x[0] if k == 0 else np.interp(level, y[k - 1 : k + 1], x[k - 1 : k + 1]))


def training_time(run: Run) -> float:
    """Seconds in the paper's sense: of a model that learns by steps until its training accuracy
    exceeded 90 % (infinite if it never did), of any other until it is done."""
    if not run.iterative:
        return run.record.training_s
    reached = run.record.time_to_target_train_s
    return math.inf if reached is None else reached


def quartiles(times: Sequence[float]) -> list[float]:
    """Quartiles of times of which some may be infinite; one between a number and infinity is."""
    ordered = np.sort(times)
    result = []
    for q in (0.25, 0.5, 0.75):
        place = q * (len(ordered) - 1)
        below, above = ordered[int(np.floor(place))], ordered[int(np.ceil(place))]
        result.append(math.inf if np.isinf(above) else float(below + place % 1 * (above - below)))
    return result


def mcnemar(runs: Sequence[Run], reference: Sequence[Run]) -> float | None:
    """Exact McNemar test on the same test samples of all seeds that both have; None without any.

    That samples are the same is proven by the digest of their frames and labels.
    """
    theirs = {(run.seeds, run.record.data_sha256.test): run.record.right for run in reference}
    pairs = [
        (run.record.right, theirs[key])
        for run in runs
        if (key := (run.seeds, run.record.data_sha256.test)) in theirs
    ]
    if not pairs:
        return None
    a, b = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return evaluate.mcnemar(a, b)
