"""What is said after a verdict: counts and ranges of the evidence, so that no word outlives them.

Each function takes the rows of one claim, as :func:`.view.evidence` has them, and returns a phrase.
"""

from __future__ import annotations

import pandas as pd

from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import RIVAL
from experiments.reporting.text import CAPTURED, COMPUTED, number
from experiments.studies.claims import rules
from experiments.studies.claims.rules import NO, YES

DECIDING = (CAPTURED, COMPUTED)
LEAST = 100 * rules.MARGIN


def against_rival(rows: pd.DataFrame) -> str:
    """On how many captured and computed recordings HDC is ahead of its rival, and behind it."""
    rows = rows[rows.kind.isin(DECIDING) & (rows.unit == "points")]
    if not len(rows):
        return ""
    differences = _estimates(rows)
    ahead = sum(rules.more_accurate(each) == YES for each in differences)
    behind = sum(rules.at_least_as_accurate(each) == NO for each in differences)
    return (
        f"ahead of {_inside(display_name(RIVAL))} by {LEAST:g} points or more on {ahead} of "
        f"{_recordings(len(rows))}, behind by as much on {behind}"
    )


def not_behind(rows: pd.DataFrame) -> str:
    """On how many captured and computed recordings HDC needs no more frames than its rival."""
    rows = rows[rows.kind.isin(DECIDING)]
    if not len(rows):
        return ""
    words = rows.verdict.value_counts()
    return (
        f"not behind {_inside(display_name(RIVAL))} by {LEAST:g} points on {words.get(YES, 0)} of "
        f"{_recordings(len(rows))}, behind on {words.get(NO, 0)}"
    )


def times(rows: pd.DataFrame) -> str:
    """Of each model the lowest and the highest ratio, by each way of computing HDC."""
    ranges: dict[str, list[str]] = {}
    for row in rows.to_dict("records"):
        model, _, way = row["evidence"].partition(", over ")
        ends = [row["value_low"], row["value_high"]]
        if any(pd.isna(end) for end in ends):
            ends = [row["value"]]
        shown = "–".join(number(end, 2) for end in ends)
        ranges.setdefault(model, []).append(f"×{shown} over {way}")
    return "; ".join(f"{model} {', '.join(found)}" for model, found in ranges.items())


def contrast(rows: pd.DataFrame) -> str:
    """Where prototypes have more contrast than the speckle, and where they have less."""
    higher = rows[rows.value > 0].evidence
    lower = rows[rows.value <= 0].evidence
    parts = []
    if len(higher):
        parts.append(f"higher than that of the speckle on {', '.join(higher)}")
    if len(lower):
        parts.append(f"lower on {', '.join(lower)}")
    return ", ".join(parts)


def recalibration(rows: pd.DataFrame) -> str:
    """How often an update of HDC gains, and how often ridge regression gains more than any."""
    rows = rows[rows.kind.isin(DECIDING)]
    names = rows.evidence.str.partition(", ")[0]
    places = rows.groupby(names, sort=False)
    gained = better = compared = 0
    for _, part in places:
        of_ridge = part.evidence.str.contains("ridge")
        of_hdc = part[~of_ridge]
        gained += int((of_hdc.verdict == YES).any())
        if of_ridge.any() and len(of_hdc):
            compared += 1
            ridge = part[of_ridge].value
            better += int(ridge.max() > of_hdc.value.max())
    if not len(places):
        return ""
    text = f"HDC with p = 0.75 gains on {gained} of {_recordings(len(places))}"
    if compared:
        text += f"; ridge regression gains more than HDC on {better} of {compared}"
    return text


def faults(rows: pd.DataFrame) -> str:
    """The change of each model, from the least to the greatest loss."""
    parts = []
    models = rows.evidence.str.rpartition(", ")[0]
    for model, part in rows.groupby(models, sort=False):
        least, most = part.value.min(), part.value.max()
        ends = sorted({f"{least:+.1f}", f"{most:+.1f}"})
        parts.append(f"{model} {' to '.join(ends)} points".replace("-", "−"))
    return "; ".join(parts)


PHRASES = {
    "accuracy": against_rival,
    "networks": times,
    "softmax": times,
    "few_samples": not_behind,
    "contrast": contrast,
    "recalibration": recalibration,
    "faults": faults,
}


def _estimates(rows: pd.DataFrame) -> list[Estimate]:
    """Differences in points as fractions."""
    columns = rows[["value", "value_low", "value_high"]]
    fractions = columns.astype(float) / 100
    return [Estimate(*line) for line in fractions.itertuples(index=False)]


def _recordings(count: int) -> str:
    return f"{count} recording" if count == 1 else f"{count} recordings"


def _inside(name: str) -> str:
    """A name as it stands within a sentence; an abbreviation keeps its capitals."""
    first, rest = name[:1], name[1:]
    return name if rest[:1].isupper() else first.lower() + rest
