"""Verdicts by rules from version 4 on: the accuracy of a form of HDC minus that of the model it is
compared with, from draws to a word, and training times relative to HDC.

Draws of a recording give a difference with its variance; recordings of one source give the number
of the source, y_s with variance v_s, which few draws leave uncertain; so sources are joined by a
hierarchical model with Student's t:

    y_s ~ t(θ_s, √v_s)    θ_s ~ normal(μ, τ)    μ ~ normal    τ ~ half-normal

The rules state the degrees of freedom of t and the scales of both priors.

*Yes* where the loss is below the margin with a probability of 95 %, *no* where it is so with 5 %,
otherwise *open*; open, too, where a recording of the rules was not measured, or was disturbed. The
Student interval of sources of equal weight has columns of its own. Recordings that no model had
classified when the rules were written have a further row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records.results import of_experiment
from experiments.reporting.estimates import (
    Estimate,
    least_variance_of_difference,
    mean_interval,
)
from experiments.studies.claims.rules import (
    LARGEST,
    TRAINED,
    Asked,
    Choice,
    Claim,
    Prior,
    Recording,
    Rules,
    Size,
    Times,
)

YES, NO, OPEN = "yes", "no", "open"
CONFIRMATORY = "confirmatory"
Row = dict[str, Any]
COLUMNS = [
    *("rules", "claim", "says", "by", "rival", "size", "status", "word", "unit", "why"),
    *("mean", "mean_low", "mean_high", "probability"),
    *("equal", "equal_low", "equal_high", "sources"),
]


def judge(rules: Rules, frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each claim, size and status of recordings, and for each claim of times.

    Accuracies are in points; times are ratios.

    Args:
        rules: that judge.
        frame: lines of the experiments of the claims.
    """
    rows = []

    def add(
        name: str, asked: Asked, rival: str, size: Size, found: Row, status: str = "all"
    ) -> None:
        said = {"rules": rules.version, "claim": name, "says": asked.says}
        said |= {"by": asked.by, "rival": rival, "size": size, "status": status}
        rows.append(said | found)

    for name, claim in rules.claims.items():
        lines = of_experiment(frame, claim.experiment)
        for size in claim.sizes or rules.sizes:
            for status in ("all", CONFIRMATORY):
                if part := recordings_of(rules, claim, size, status):
                    found = _judged(rules, claim, size, part, lines)
                    add(name, claim, claim.rival, size, found, status)
    for name, times in rules.times.items():
        found = judge_times(times, of_experiment(frame, times.experiment))
        add(name, times, times.model, TRAINED, found)
    for name, choice in rules.choices.items():
        found = judge_choice(rules, choice, of_experiment(frame, choice.experiment))
        add(name, choice, choice.among[0], choice.size, found)
    return pd.DataFrame(rows, columns=COLUMNS)


def recordings_of(
    rules: Rules, claim: Claim, size: Size, status: str
) -> dict[str, Recording]:
    """The recordings that enter a claim at a size, all or the confirmatory ones; none where all
    are confirmatory."""
    named = claim.recordings or tuple(rules.recordings)
    every = {
        name: rules.recordings[name]
        for name in named
        if size in (rules.recordings[name].sizes or (size,))
    }
    if status == "all":
        return every
    part = {name: each for name, each in every.items() if each.status == status}
    return part if len(part) < len(every) else {}


def _judged(
    rules: Rules,
    claim: Claim,
    size: Size,
    recordings: Mapping[str, Recording],
    frame: pd.DataFrame,
) -> Row:
    found: dict[str, Difference] = {}
    reasons: dict[str, list[str]] = {}
    for name, recording in recordings.items():
        measured = {"scene": name}
        if claim.split:
            measured[claim.split] = recording.split
        lines = _lines(claim, size, _having(frame, measured))
        one = difference(rules, recording, claim, lines)
        if isinstance(one, str):
            reasons.setdefault(one, []).append(name)
        else:
            found[name] = one
    why = "; ".join(f"{why}: {', '.join(of)}" for why, of in reasons.items())
    row: Row = {"word": OPEN, "unit": "points", "why": why}
    if why:
        return row
    values, variances = by_source(rules, found)
    joined = Joined(values, variances, rules.prior)
    likely = joined.above(-rules.margin)
    row |= _points(joined.mean()).columns("mean") | {"probability": likely}
    row |= _points(mean_interval(values)).columns("equal")
    return row | {"sources": len(values), "word": word_of(likely, rules.sure)}


def judge_choice(rules: Rules, choice: Choice, lines: pd.DataFrame) -> Row:
    """The first form whose mean accuracy over sources is at most the margin below the best one's.

    The word is the name of the form; its mean is the gain over the first form, with its interval
    over sources of equal weight.
    """
    first, *others = choice.among
    gains: dict[str, Row] = {first: {"equal": 0.0}}
    for form in others:
        claim = choice.against_the_first(form)
        entering = recordings_of(rules, claim, choice.size, "all")
        gains[form] = row = _judged(rules, claim, choice.size, entering, lines)
        if row["why"]:
            return {"word": OPEN, "unit": "points", "why": row["why"]}
    least = max(row["equal"] for row in gains.values()) - 100 * rules.margin
    word = next(form for form, row in gains.items() if row["equal"] >= least)
    said = {"word": word, "unit": "points", "why": "", "probability": None}
    return gains[word] | said


def judge_times(times: Times, lines: pd.DataFrame) -> Row:
    """The word on a ratio of training times, and the ratios.

    Each measurement gives the ratio of medians and that of minima over its undisturbed fits. *Yes*
    where all ratios of all measurements are at least that of the claim, *no* where all are below,
    otherwise *open*. The mean is the geometric one of the ratios of medians; its range that of all.
    """
    row: Row = {"word": OPEN, "unit": "×", "why": ""}
    if len(lines):
        lines = lines[lines.threads == times.threads]
    records = list(lines.record.unique()) if len(lines) else []
    if len(records) < times.measurements:
        return row | {"why": f"{len(records)} of {times.measurements} measurements"}
    medians, every = [], []
    for record in records[: times.measurements]:
        quiet = lines[(lines.record == record) & lines.disturbed.eq("")]
        fits = quiet.groupby("model").fit_s
        counts = fits.size().reindex([times.model, times.over], fill_value=0)
        if counts.min() < times.fits:
            found = f"{counts.min()} of {times.fits} fits of {counts.idxmin()}"
            return row | {"why": f"disturbed: {found}"}
        both = (fits.median(), fits.min())
        median, least = (of[times.model] / of[times.over] for of in both)
        medians.append(median)
        every += [median, least]
    mean = float(np.exp(np.mean(np.log(medians))))
    row |= Estimate(mean, min(every), max(every)).columns("mean")
    if min(every) >= times.at_least:
        row["word"] = YES
    elif max(every) < times.at_least:
        row["word"] = NO
    return row


def word_of(likely: float, sure: float) -> str:
    """The word for the probability that the loss is below the margin."""
    if likely >= sure:
        return YES
    return NO if likely <= 1 - sure else OPEN


def _points(share: Estimate) -> Estimate:
    return Estimate(*(100 * value for value in share))


# Draws to recordings to sources -------------------------------------------------------------------


class Difference(NamedTuple):
    """How much more accurate a form is on one recording, and the variance of this number."""

    mean: float
    variance: float


def _lines(claim: Claim, size: Size, lines: pd.DataFrame) -> pd.DataFrame:
    """The lines of both models at a size, from the lines of a recording, with the columns ``form``,
    whether it is the form, and ``share`` of right answers."""
    if not len(lines):
        return lines
    form = _having(lines, {"model": claim.form, **claim.of_form})
    rival = _having(lines, {"model": claim.rival, **claim.of_rival})
    right, asked = claim.rival_right or claim.right, claim.rival_asked or claim.asked
    both = pd.concat(
        [
            form.assign(form=True, share=form[claim.right] / form[claim.asked]),
            rival.assign(form=False, share=rival[right] / rival[asked]),
        ]
    )
    if size == TRAINED:
        return both
    return both[both.n == (both.n.max() if size == LARGEST else size)]


def _having(lines: pd.DataFrame, values: Mapping[str, Any]) -> pd.DataFrame:
    """The lines that have these values in these columns."""
    for column, value in values.items():
        if len(lines):
            lines = lines[lines[column] == value]
    return lines


def difference(
    rules: Rules, recording: Recording, claim: Claim, lines: pd.DataFrame
) -> Difference | str:
    """The mean over the first draws in which both models were asked, or why there is none.

    Args:
        rules: how many draws count, and what they share.
        recording: where the lines are of.
        claim: the two models, and the columns of their numbers.
        lines: a line per draw and model.
    """
    if not len(lines):
        return "not measured"
    asked = lines[claim.asked]
    drawn = [name for name in ("seed", "draw") if name in lines.dropna(axis=1)]
    shares = lines.pivot_table("share", drawn, "form")
    both = shares.reindex(columns=[True, False]).dropna()
    less = (both[True] - both[False]).to_numpy(float)
    k = recording.groups or claim.draws or rules.draws
    if len(less) < k:
        return f"{len(less)} of {k} draws measured"
    less = less[:k]  # a further draw moves no word
    n, mean = float(asked.mean()), float(less.mean())
    least = least_variance_of_difference(n * abs(mean), n, n)
    of_one = max(float(less.var(ddof=1)) if k > 1 else 0.0, least)
    return Difference(mean, of_one * (1 / k + rules.shared))


def by_source(
    rules: Rules, found: Mapping[str, Difference]
) -> tuple[list[float], list[float]]:
    """The number of each source, the mean of its recordings, and its variance: that within the
    recordings or that between them, whichever is larger, over how many there are."""
    sources = [rules.recordings[name].source for name in found]
    every = pd.DataFrame(found.values(), columns=Difference._fields)
    by_source = every.groupby(sources, sort=False)
    within, between = by_source.variance.mean(), by_source["mean"].var().fillna(0.0)
    variances = np.maximum(within, between) / by_source.size()
    return by_source["mean"].mean().tolist(), variances.tolist()


# Sources to all -----------------------------------------------------------------------------------

STEP = 0.001  # of the grid of μ, whose cells end at multiples of it
MEANS = STEP * (np.arange(-500, 500) + 0.5)
N_BETWEEN = 32  # values of τ, each as likely by its prior
N_SCALES = 12  # nodes for Student's t


def _variances(
    prior: Prior,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """τ²; and Student's t as a mixture of normals: factors of a variance, and their weights."""
    from scipy.special import ndtri, roots_genlaguerre

    shares = (np.arange(N_BETWEEN) + 0.5) / N_BETWEEN
    between = prior.between * ndtri((1 + shares) / 2)
    half = prior.freedom / 2
    nodes, weights = roots_genlaguerre(N_SCALES, half - 1)
    return between**2, half / nodes, weights / weights.sum()


class Joined:
    """The posterior of μ given numbers of sources, on a grid.

    Args:
        values: a number of each source [k].
        variances: of each [k], above zero.
        prior: of the mean and of what is between sources.
    """

    def __init__(
        self, values: Sequence[float], variances: Sequence[float], prior: Prior
    ) -> None:
        between, factors, weights = _variances(prior)
        log = np.zeros((len(MEANS), len(between)))
        for value, variance in zip(values, variances, strict=True):
            of_each = between[:, None] + variance * factors
            squares = (value - MEANS)[:, None, None] ** 2
            density = weights / np.sqrt(of_each) * np.exp(-squares / (2 * of_each))
            log += np.log(density.sum(axis=2) + np.finfo(float).tiny)
        log -= ((MEANS / prior.mean) ** 2 / 2)[:, None]
        posterior = np.exp(log - log.max()).sum(axis=1)
        self.shares = posterior / posterior.sum()

    def above(self, limit: float) -> float:
        """The probability that μ is above a limit."""
        return float(self.shares[limit < MEANS].sum())

    def mean(self) -> Estimate:
        """The mean of μ with its central 95 %."""
        ends = np.interp((0.025, 0.975), self.shares.cumsum(), MEANS + STEP / 2)
        return Estimate(float(self.shares @ MEANS), *ends.tolist())
