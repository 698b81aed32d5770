"""Gain of one model over another on the same test frames, with an interval, and advice."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hdc.accuracy import wilson
from hdc.command.messages import printable

RESAMPLES = 2000
"""Number of the test frames, for the interval of a difference of errors."""
UNCHOSEN = "nothing was chosen: too few training frames of a class"


@dataclass(frozen=True)
class Gain:
    """Advantage of one model over another, and its 95 % interval; positive is better."""

    gain: float
    low: float
    high: float

    def as_json(self) -> dict[str, float]:
        return {"gain": self.gain, "low": self.low, "high": self.high}


def paired_accuracies(mine: np.ndarray, theirs: np.ndarray) -> Gain:
    """Difference of two accuracies on the same frames, from right answers bool [Q] of each.

    Newcombe's interval for pairs (Stat. Med. 17, 2635 (1998), method 10): Wilson's intervals of
    both, joined with the correlation of the two. Frames count as independent.
    """
    n = len(mine)
    both = int((mine & theirs).sum())
    only_mine = int((mine & ~theirs).sum())
    only_theirs = int((~mine & theirs).sum())
    neither = n - both - only_mine - only_theirs
    first, second = both + only_mine, both + only_theirs
    phi = 0.0
    product = first * (n - first) * second * (n - second)
    if product > 0:
        agreement = float(both * neither - only_mine * only_theirs)
        if agreement > 0:
            agreement = max(agreement - n / 2, 0)
        phi = agreement / math.sqrt(product)
    p, q = first / n, second / n
    p_low, p_high = wilson(first, n)
    q_low, q_high = wilson(second, n)
    below = _joined(p - p_low, q_high - q, phi)
    above = _joined(p_high - p, q - q_low, phi)
    return Gain(p - q, p - q - below, p - q + above)


def _joined(a: float, b: float, phi: float) -> float:
    return math.sqrt(max(a * a - 2 * phi * a * b + b * b, 0.0))


def paired_errors(mine: np.ndarray, theirs: np.ndarray) -> Gain:
    """How much less the mean of one's errors is on the same frames, from errors [Q] of each.

    A bootstrap over the test frames (percentiles of 2000 resamples). Frames count as independent.
    """
    differences = theirs - mine
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(differences), (RESAMPLES, len(differences)))
    means = differences[drawn].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975]).tolist()
    return Gain(float(differences.mean()), low, high)


# Sentences ---------------------------------------------------------------------------------------


def of_classes(result: Mapping[str, Any]) -> list[str]:
    """The line to type, its gain, and whether a baseline outside the library is better."""
    test = result["tests"][-1]
    chosen, published = result["chosen"], result["published"]
    where = f"on {test['tested']} frames of {test['name']}"
    mine = test["methods"][chosen]["accuracy"]
    lines = [f"Use: {result['command']}"]
    if chosen == published:
        why = f"No combination was better than the published form by {result['chosen_by']}"
        if not result["chosen_by"]:
            why = UNCHOSEN.capitalize()
        lines.append(f"{why}; the published form has {mine:.1%} {where}.")
    else:
        gain = test["gain"]
        lines.append(
            f"It has {mine:.1%} {where}, the published form "
            f"{test['methods'][published]['accuracy']:.1%}: {_points(gain)}."
        )
        lines.append(_clear_or_not(gain))
    if result["rival"]:
        over = test["rival_gain"]
        share = test["methods"][result["rival"]]["accuracy"]
        amount = f"{result['rival']} has {share:.1%}, {_points(over)}"
        lines.append(_against_rival(over, amount))
    return lines


def of_values(result: Mapping[str, Any]) -> list[str]:
    """Like :func:`of_classes`, with a line of errors for each value."""
    test = result["tests"][-1]
    chosen, published = result["chosen"], result["published"]
    where = f"on {test['tested']} frames of {test['name']}"
    lines = [f"Use: {result['command']}"]
    for name, gain in test["gain"].items():
        unit = f" {result['units'][name]}" if result["units"].get(name) else ""
        mine = test["methods"][chosen]["errors"][name]
        own = f"{printable(name)}: mean absolute error {mine:.4g}{unit} {where}"
        if chosen == published:
            why = f"no combination was better by {result['chosen_by']}"
            if not result["chosen_by"]:
                why = UNCHOSEN
            lines.append(f"{own}; {why}.")
        else:
            theirs = test["methods"][published]["errors"][name]
            less = f"{_interval(gain)}{unit} less"
            lines.append(f"{own}, {published} {theirs:.4g}{unit}: {less}.")
            lines.append(_clear_or_not(gain))
        if result["rival"]:
            over = test["rival_gain"][name]
            error = test["methods"][result["rival"]]["errors"][name]
            amount = (
                f"{result['rival']} has {error:.4g}{unit}, {_interval(over)}{unit} less"
            )
            lines.append(_against_rival(over, amount))
    return lines


def of_dither(result: Mapping[str, Any]) -> list[str]:
    """Cost of one grey level of dither, and advice where it is high."""
    found = result["dither"]
    if not found:
        return []
    before, after = found["before"], found["after"]
    if "values" in result:
        amount = f"{before:.3g} to {after:.3g} of a guess's error"
    else:
        amount = f"{before:.1%} to {after:.1%}"
    where = result["tests"][-1]["name"]
    lines = [
        f"With one grey level of dither on {where}: {amount} (seed {found['seed']})."
    ]
    if found["warns"]:
        lines.append(
            "Warning: rounding decides many of these bits. Try another form (--encoder "
            "reference_levels, deviation or smoothed), or record with more light or exposure."
        )
    return lines


def _against_rival(over: Mapping[str, float], amount: str) -> str:
    if over["low"] > 0:
        return f"A baseline outside the library is better: {amount}."
    if over["high"] < 0:
        return f"The best baseline outside the library is worse: {amount}."
    return f"The best baseline outside the library is not clearly better or worse: {amount}."


def _clear_or_not(gain: Mapping[str, float]) -> str:
    if gain["low"] > 0:
        return "That is a clear gain, if these frames are like those to come."
    if gain["high"] < 0:
        return "That is a loss: the choice does not carry over to these frames."
    return "That is no clear gain: the interval holds zero."


def _points(gain: Mapping[str, float]) -> str:
    low, high = 100 * gain["low"], 100 * gain["high"]
    return f"{100 * gain['gain']:+.1f} points (95 % interval {low:+.1f} to {high:+.1f})"


def _interval(gain: Mapping[str, float]) -> str:
    return f"{gain['gain']:.4g} (95 % interval {gain['low']:.4g} to {gain['high']:.4g})"
