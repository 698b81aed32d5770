"""From pieces of evidence to the verdict of a claim against a baseline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import FACTORS, Piece
from experiments.studies.claims.random_effects import (
    Pooled,
    of_laboratory,
    random_effects,
)
from experiments.studies.claims.rules import (
    UNDECIDED,
    by_all_ways,
    refuted,
    rule_of,
    shared,
)

BY_WORDS = ("much_slower", "sharper")  # rules on words of ways and scenes
_NOTHING = Pooled(Estimate(math.nan), math.nan, math.nan, math.nan, 0)


class Verdict(NamedTuple):
    """The verdict of a claim against a baseline.

    Attributes:
        word: one of four.
        pooled: the number across sensors; of times that of the way with the least ratio; NaN where
            the rule takes none.
        frames: kinds that decided.
        decided_by: the pieces that entered.
    """

    word: str
    pooled: Pooled
    frames: str
    decided_by: Sequence[Piece]

    def columns(self, piece: Piece) -> dict[str, Any]:
        """The columns of a table, in the unit of a piece and within what it can be."""
        equal = Estimate(math.nan)
        if self.pooled.units:
            equal = equal_weights(self.decided_by)
        return {
            "word": self.word,
            **columns_of(self.pooled, piece),
            **Estimate(*_in_unit(piece, equal)).columns("equal"),
            "laboratories": self.pooled.units or None,
            "frames": self.frames,
        }


def columns_of(pooled: Pooled, piece: Piece) -> dict[str, Any]:
    """The mean with its interval and the range for a new sensor, in the unit of a piece."""
    predicted = _in_unit(piece, (pooled.predicted_low, pooled.predicted_high))
    return {
        "unit": piece.unit,
        **Estimate(*_in_unit(piece, pooled.mean)).columns("mean"),
        "predicted_low": predicted[0],
        "predicted_high": predicted[1],
    }


def _in_unit(piece: Piece, numbers: Sequence[float]) -> list[float]:
    """Numbers in the unit of a piece; a difference of accuracies ends where it can be no larger."""
    if piece.unit == "points":
        numbers = np.clip(numbers, *piece.possible).tolist()
    return [FACTORS.get(piece.unit, 1) * number for number in numbers]


def settled(piece: Piece, claim: Claim) -> Piece:
    """A piece that enters only if frames of its kind decide the claim, and if its variance is known
    where numbers are joined across sensors."""
    remarks = []
    if not {"times", piece.frames} & set(claim.decide):
        remarks.append("simulated frames cannot rank models")
    is_joined = claim.rule not in BY_WORDS
    if is_joined and math.isnan(piece.variance):
        remarks.append("of one draw or seed, or all agree, so its variance is unknown")
    if not piece.enters or not remarks:
        return piece
    return replace(
        piece, enters=False, remark="; ".join(filter(None, [piece.remark, *remarks]))
    )


def verdict(claim: Claim, pieces: Sequence[Piece], frozen: Rules) -> Verdict | None:
    """The verdict on the pieces of one claim and baseline; None where there is no evidence."""
    entering = [piece for piece in pieces if piece.enters]
    if claim.rule == "much_slower":
        return _of_times(entering, frozen)
    if claim.rule == "sharper":
        return _of_scenes(entering)
    if entering:
        return _across_sensors(claim, entering, frozen)
    words = [p.word for p in pieces if p.frames == SIMULATED and p.word]
    if not words:
        return None
    word = refuted(words)
    return Verdict(word, _NOTHING, SIMULATED, [])


def pooled_over(pieces: Sequence[Piece]) -> Pooled:
    """The number across sensors; the unit is a laboratory."""
    values, variances = zip(*_laboratories(pieces), strict=True)
    return random_effects(values, variances)


def equal_weights(pieces: Sequence[Piece]) -> Estimate:
    """The mean over laboratories, each of which weighs the same, with Student's interval."""
    return mean_interval([value for value, _ in _laboratories(pieces)])


def _laboratories(pieces: Sequence[Piece]) -> list[tuple[float, float]]:
    """The number of each laboratory and its variance."""
    units: dict[str, list[Piece]] = {}
    for piece in pieces:
        units.setdefault(piece.laboratory, []).append(piece)
    return [
        of_laboratory(
            [piece.estimate.value for piece in of_unit],
            [piece.variance for piece in of_unit],
        )
        for of_unit in units.values()
    ]


def _across_sensors(claim: Claim, entering: Sequence[Piece], frozen: Rules) -> Verdict:
    """Verdict by the rule on the interval of the mean over laboratories."""
    pooled = pooled_over(entering)
    rule = rule_of(claim.rule, frozen, claim.share)
    frames = ", ".join(dict.fromkeys(piece.frames for piece in entering))
    word = UNDECIDED
    if pooled.units >= claim.least_units:
        word = rule.across(pooled, frozen.few_units)
    return Verdict(word, pooled, frames, entering)


def _of_times(entering: Sequence[Piece], frozen: Rules) -> Verdict | None:
    """Verdict by those of all implementations; none before all were measured."""
    if {piece.evidence for piece in entering} != set(frozen.ways):
        return None
    words = [piece.word for piece in entering]
    least = min(entering, key=lambda piece: piece.estimate.value)
    pooled = Pooled(least.estimate, math.nan, math.nan, math.nan, 0)
    return Verdict(by_all_ways(words), pooled, SIMULATED, entering)


def _of_scenes(entering: Sequence[Piece]) -> Verdict | None:
    """Verdict by those of all scenes; a contrast has no mean over scenes."""
    if not entering:
        return None
    words = [piece.word for piece in entering]
    frames = ", ".join(dict.fromkeys(piece.frames for piece in entering))
    return Verdict(shared(words), _NOTHING, frames, entering)
