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


def sentences(result: Mapping[str, Any]) -> list[str]:
    """The line to type, its gain, and whether a baseline outside the library is better."""
    test = result["tests"][-1]
    lines = [f"Use: {result['command']}"]
    for value in result.get("values", (None,)):
        lines += _of_one(result, test, value)
    return lines


def _of_one(
    result: Mapping[str, Any], test: Mapping[str, Any], value: str | None
) -> list[str]:
    """Sentences on the accuracy, or on one value."""
    chosen, published, rival = (result[k] for k in ("chosen", "published", "rival"))

    def amount(name: str) -> str:
        return _amount(test["methods"][name], value, result)

    unit = "" if value is None else result["units"].get(value, "")
    gain, over = (
        found if value is None else found.get(value, {})
        for found in (test["gain"], test.get("rival_gain", {}))
    )
    subject = "Accuracy" if value is None else f"Error of {printable(value)}"
    where = f"{test['tested']} frames of {test['name']}"
    if test["name"] == "the last frames":
        where = f"the last {test['tested']} frames"
    own = f"{subject} on {where}: {amount(chosen)}"
    if chosen == published:
        why = f"no other form was better by {result['chosen_by']}"
        lines = [f"{own}; {why if result['chosen_by'] else UNCHOSEN}."]
    else:
        won = _won(gain, value, unit)
        other = f"that of {published}" if value else "the published form"
        lines = [f"{own}, {other} {amount(published)}: {won}."]
        lines.append(_clear_or_not(gain))
    if rival:
        won = f"{rival} has {amount(rival)}, {_won(over, value, unit)}"
        lines.append(_against_rival(over, won))
    return lines


def _amount(
    found: Mapping[str, Any], value: str | None, result: Mapping[str, Any]
) -> str:
    """An accuracy, or the error of a value with its unit."""
    if value is None:
        return f"{found['accuracy']:.1%}"
    unit = result["units"].get(value, "")
    return f"{found['errors'][value]:.4g} {unit}".rstrip()


def _won(gain: Mapping[str, float], value: str | None, unit: str) -> str:
    """A difference with its interval: points of accuracy, or how much less an error is."""
    if value is not None:
        ends = f"{gain['low']:.4g} to {gain['high']:.4g}"
        return f"{gain['gain']:.4g} {unit}".rstrip() + f" less (95 % interval {ends})"
    low, high = 100 * gain["low"], 100 * gain["high"]
    return f"{100 * gain['gain']:+.1f} points (95 % interval {low:+.1f} to {high:+.1f})"


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
