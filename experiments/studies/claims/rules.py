"""Rules that turn numbers into one of four words; docs/verdicts.md states them in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from experiments.reporting.estimates import Estimate

YES, NO, PARTLY, UNDECIDED = "yes", "no", "partly", "undecided"
MARGIN = (
    0.03  # of accuracies, as in published.csv: a smaller difference decides nothing
)
TIMES = 10  # a training "much faster" takes at most this part of its rival's time


def more_accurate(difference: Estimate) -> str:
    """Whether HDC is more accurate than its rival, whose accuracy was subtracted from its own.

    Yes: the difference is at least the margin and its interval lies above zero. No: the interval
    lies below the margin. Undecided otherwise.
    """
    if math.isnan(difference.low) or math.isnan(difference.high):
        return UNDECIDED
    if difference.low > 0 and difference.value >= MARGIN:
        return YES
    return NO if difference.high < MARGIN else UNDECIDED


def at_least_as_accurate(difference: Estimate) -> str:
    """Whether HDC is less accurate than its rival by no more than the margin.

    Yes: the interval lies above −margin. No: the difference is at most −margin and its interval
    lies below zero. Undecided otherwise.
    """
    opposite = more_accurate(
        Estimate(-difference.value, -difference.high, -difference.low)
    )
    return {YES: NO, NO: YES}.get(opposite, UNDECIDED)


def slower(ratios: Sequence[float]) -> str:
    """Whether a rival trains at least ten times as long as HDC, from the ratio of each run.

    Yes: in every run. No: in none. Undecided otherwise, or without a run.
    """
    above = [ratio >= TIMES for ratio in ratios]
    if not above or any(above) != all(above):
        return UNDECIDED
    return YES if all(above) else NO


def combine(verdicts: Iterable[str]) -> str:
    """One word for several: the word that all decided ones share, else partly."""
    decided = {verdict for verdict in verdicts if verdict != UNDECIDED}
    if not decided:
        return UNDECIDED
    return decided.pop() if len(decided) == 1 else PARTLY


def judge(deciding: Iterable[str], simulated: Iterable[str]) -> str:
    """The verdict on a claim: that of captured and computed frames; simulated ones can only
    refute."""
    word = combine(deciding)
    if word != UNDECIDED:
        return word
    return NO if combine(simulated) == NO else UNDECIDED
