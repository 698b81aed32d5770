"""Rules that turn numbers into one of four words; docs/claims.md states them in sentences, and
rules.yaml has their numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from experiments.reporting.estimates import Estimate
from experiments.studies.claims.frozen import Rules, rules
from experiments.studies.claims.random_effects import Pooled

YES, NO, PARTLY, UNDECIDED = "yes", "no", "partly", "undecided"


# One sensor, and an interval from anywhere --------------------------------------------------


def more_accurate(difference: Estimate, margin: float) -> str:
    """Whether HDC is more accurate than its baseline, whose accuracy was subtracted from its own.

    Yes: the difference is at least the margin and its interval lies above zero. No: the interval
    lies below the margin. Undecided otherwise.
    """
    if math.isnan(difference.low) or math.isnan(difference.high):
        return UNDECIDED
    if difference.low > 0 and difference.value >= margin:
        return YES
    return NO if difference.high < margin else UNDECIDED


def at_least_as_accurate(difference: Estimate, margin: float) -> str:
    """Whether HDC is less accurate than its baseline by no more than the margin.

    Yes: the interval lies above −margin. No: the difference is at most −margin and its interval
    lies below zero. Undecided otherwise.
    """
    opposite = more_accurate(
        Estimate(-difference.value, -difference.high, -difference.low), margin
    )
    return {YES: NO, NO: YES}.get(opposite, UNDECIDED)


def above(number: Estimate, limit: float) -> str:
    """Whether an interval lies above a limit (yes), below it (no), or holds it (undecided)."""
    if number.low > limit:
        return YES
    return NO if number.high < limit else UNDECIDED


class Rule(NamedTuple):
    """A rule on an interval: `word` of the interval and `margin`, and the `limit` that an interval
    of few laboratories must not hold."""

    word: Callable[[Estimate, float], str]
    margin: float
    limit: float

    def of_one(self, number: Estimate) -> str:
        """The word of one sensor."""
        return self.word(number, self.margin)

    def across(self, pooled: Pooled, few: int) -> str:
        """The word across sensors; fewer laboratories than `few` need all of the interval on one
        side of the limit."""
        word = self.of_one(pooled.mean)
        holds = pooled.mean.low <= self.limit <= pooled.mean.high
        return UNDECIDED if pooled.units < few and holds else word


def rule_of(name: str, frozen: Rules | None = None, share: float = 0.0) -> Rule:
    """The rule of this name; `share` is the limit of ``restored``.

    Raises:
        ValueError: there is no such rule on intervals.
    """
    margin = (frozen or rules()).margin
    known = {
        "more_accurate": Rule(more_accurate, margin, margin),
        "at_least_as_accurate": Rule(at_least_as_accurate, margin, -margin),
        # The share of a loss that came back; a scene on which drift cost too little has no word.
        "restored": Rule(above, share, share),
        # Contrast of prototypes minus that of what they are compared with, scene by scene.
        "sharper": Rule(above, 0.0, 0.0),
    }
    if name not in known:
        raise ValueError(f"rule: expected one of {', '.join(known)}, found {name}")
    return known[name]


# Several --------------------------------------------------------------------------------------


def shared(words: Iterable[str]) -> str:
    """The word that all share; partly where they differ; undecided without any."""
    found = set(words)
    if not found:
        return UNDECIDED
    return found.pop() if len(found) == 1 else PARTLY


def refuted(simulated: Iterable[str]) -> str:
    """Verdict of simulated scenes alone: no, if each of them says so."""
    found = set(simulated)
    return NO if found == {NO} else UNDECIDED


def much_slower(ratio: Estimate, runs: int, frozen: Rules | None = None) -> str:
    """Whether a baseline trains at least ten times as long as HDC in the same implementation.

    Args:
        ratio: of the times; bounds are those of the order-statistic interval, or the lowest and the
            highest run where there are too few for one.
        runs: how many.
        frozen: the rules.
    """
    frozen = frozen or rules()
    if runs >= frozen.runs.least:
        return above(ratio, frozen.times)
    low = ratio.value if math.isnan(ratio.low) else ratio.low
    high = ratio.value if math.isnan(ratio.high) else ratio.high
    if low > frozen.times * frozen.runs.factor:
        return YES
    return NO if high < frozen.times / frozen.runs.factor else UNDECIDED


def by_all_ways(words: Sequence[str]) -> str:
    """The word of a claim on times from those of all ways: yes or no if all say so, partly if at
    least one says yes, undecided otherwise."""
    if len(set(words)) == 1:
        return words[0]
    return PARTLY if YES in words else UNDECIDED
