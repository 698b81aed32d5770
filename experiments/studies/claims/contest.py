"""Bits against grey values by rules 3, from the records of ``experiment=recordings_chosen``.

``python -m experiments.studies.claims.contest`` prints the verdict, or that none is measured.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from experiments.records.files import results_dir
from experiments.records.results import Results, of_scenes
from experiments.records.rows import unpack_labels
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.measured import fields_of
from experiments.studies.claims import recordings
from experiments.studies.claims.frozen import PATH, Claim, Recording
from experiments.studies.claims.piece import CONFIRMATORY, variance_of
from experiments.studies.claims.random_effects import (
    of_laboratory,
    random_effects,
)
from experiments.studies.claims.rules import NO, UNDECIDED, YES

RULES_3 = PATH.with_name("rules_3.yaml")
NOT_MEASURED = "not measured yet"


class Rules(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of rules_3.yaml, which says what each is."""

    version: int
    dated: Any
    claim: str
    experiment: str
    bits: str
    greys: str
    margin: float
    saturated: float
    sizes: dict[str, tuple[int, ...]]
    input_fields: int
    fixed: str
    beside: dict[str, tuple[str, ...]]
    confidence: float
    least_units: int
    resamples: int
    recordings: dict[str, Recording]
    readings: dict[str, str]


@functools.cache
def rules() -> Rules:
    """Rules 3.

    Raises:
        ValueError: naming the file and the key that is wrong.
    """
    try:
        return msgspec.convert(OmegaConf.to_container(OmegaConf.load(RULES_3)), Rules)
    except msgspec.ValidationError as error:
        raise ValueError(f"{RULES_3}: {error}") from None


class Measured(NamedTuple):
    """Bits minus greys on one recording: mean and its variance, which is NaN of a single draw."""

    laboratory: str
    value: float
    variance: float


class Verdict(NamedTuple):
    """A word with both intervals that it needs."""

    word: str
    equal: Estimate
    random: Estimate
    units: int


def measured(frame: pd.DataFrame) -> dict[str, Measured]:
    """Each recording of the rules that was measured by their split, by name."""
    frozen = rules()
    found = {}
    for scene, rows in of_scenes(frame, frozen.experiment).items():
        compared = _compared(scene, rows)
        if compared is None:
            continue
        variance = variance_of(compared.by_unit, compared.n_test, compared.seeds)
        mean = float(np.mean(compared.by_unit))
        laboratory = frozen.recordings[scene].laboratory
        found[scene] = Measured(laboratory, mean, variance)
    return found


def _compared(scene: str, rows: pd.DataFrame) -> recordings.Compared | None:
    frozen = rules()
    listed = frozen.recordings.get(scene)
    if listed is None or fields_of(rows) != frozen.input_fields:
        return None
    if not recordings.is_split(rows, listed):
        return None
    claim = Claim(frozen.experiment, "", (), sizes="full")
    return recordings.compare(rows, frozen.bits, frozen.greys, claim, frozen)


def verdict(found: dict[str, Measured]) -> Verdict | None:
    """The verdict of recordings joined by laboratory; None without one of a known variance."""
    by_laboratory: dict[str, list[Measured]] = {}
    for one in found.values():
        if not np.isnan(one.variance):
            by_laboratory.setdefault(one.laboratory, []).append(one)
    if not by_laboratory:
        return None
    pairs = [
        of_laboratory([one.value for one in own], [one.variance for one in own])
        for own in by_laboratory.values()
    ]
    values, variances = zip(*pairs, strict=True)
    equal, random = mean_interval(values), random_effects(values, variances).mean
    word = word_of(equal, random) if len(values) >= rules().least_units else UNDECIDED
    return Verdict(word, equal, random, len(values))


def word_of(*intervals: Estimate) -> str:
    """Yes where all lower ends lie above −margin, no where all upper ends lie below it."""
    limit = -rules().margin
    if all(each.low > limit for each in intervals):
        return YES
    return NO if all(each.high < limit for each in intervals) else UNDECIDED


def leave_one_out(found: dict[str, Measured]) -> dict[str, Verdict | None]:
    """The verdict without each laboratory in turn."""
    laboratories = dict.fromkeys(one.laboratory for one in found.values())
    return {
        name: verdict({k: v for k, v in found.items() if v.laboratory != name})
        for name in laboratories
    }


def confirmed(frame: pd.DataFrame) -> dict[str, Estimate]:
    """Bits less greys on each confirmatory recording, with the interval over its test objects."""
    frozen = rules()
    found = {}
    for scene, rows in of_scenes(frame, frozen.experiment).items():
        compared = _compared(scene, rows)
        if compared is None or frozen.recordings[scene].status != CONFIRMATORY:
            continue
        found[scene] = over_objects(_by_object(rows, compared.sizes[0]))
    return found


def over_objects(counts: np.ndarray) -> Estimate:
    """The mean difference of frames, with the central 95 % of resampled objects.

    Args:
        counts: of each test object, right of bits less right of greys, and frames, [M, 2].
    """
    random = np.random.default_rng(0)
    n = len(counts)
    means = []
    for _ in range(rules().resamples):
        wins, frames = counts[random.integers(0, n, n)].sum(0)
        means.append(wins / frames)
    tail = (1 - rules().confidence) / 2
    low, high = np.quantile(means, (tail, 1 - tail))
    wins, frames = counts.sum(0)
    return Estimate(float(wins / frames), float(low), float(high))


def _by_object(rows: pd.DataFrame, n: int) -> np.ndarray:
    """Differences and frames of each test object over all draws, float64 [M, 2]."""
    frozen = rules()
    counts: dict[tuple[int, int], np.ndarray] = {}
    counting = rows[rows.split == "counts"]
    for _, of_draw in counting.groupby(["seed", "draw"]):
        first = of_draw[of_draw.labels.notna()].iloc[0]
        labels, groups = unpack_labels(first.labels), unpack_labels(first.groups)
        right = [
            _right(of_draw, name, n, labels) for name in (frozen.bits, frozen.greys)
        ]
        less = right[0] - right[1]
        for label, group, won in zip(labels, groups, less, strict=True):
            key = int(label), int(group)
            counts[key] = counts.get(key, np.zeros(2)) + np.array([won, 1.0])
    return np.stack(list(counts.values()))


def _right(rows: pd.DataFrame, model: str, n: int, labels: np.ndarray) -> np.ndarray:
    """1 where a model is right at n frames of a class, else 0, [Q]."""
    row = rows[rows.model == model].iloc[0]
    predicted = unpack_labels(row.predicted[list(row.n).index(n)])
    return (predicted == labels).astype(float)


def lines(frame: pd.DataFrame) -> list[str]:
    """Results of rules 3 on the records, a sentence each."""
    found = measured(frame)
    whole = verdict(found)
    if whole is None:
        return [f"{rules().claim}: {NOT_MEASURED}"]
    said = [f"{rules().claim}: {_said(whole)}"]
    for name, without in leave_one_out(found).items():
        said.append(f"without {name}: {_said(without)}")
    for scene, difference in confirmed(frame).items():
        said.append(
            f"{scene}, confirmatory: {word_of(difference)}, {_points(difference)}"
        )
    return said


def _said(found: Verdict | None) -> str:
    if found is None:
        return NOT_MEASURED
    both = (
        f"equal weights {_points(found.equal)}, random effects {_points(found.random)}"
    )
    return f"{found.word}, {both}, {found.units} laboratories"


def _points(difference: Estimate) -> str:
    value, low, high = (100 * each for each in difference)
    return f"{value:+.1f} points [{low:+.1f}, {high:+.1f}]".replace("-", "−")


if __name__ == "__main__":
    print("\n".join(lines(Results(results_dir()).frame(rules().experiment))))
