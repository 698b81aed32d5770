"""Bits against grey values by rules 3, from the records of ``experiment=recordings_chosen``."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pandas as pd

from experiments.records.results import RUNS
from experiments.records.rows import unpack_labels
from experiments.reporting.columns import Column, Row, display_name
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.measured import fields_of
from experiments.reporting.study import RUN
from experiments.reporting.table import Table
from experiments.reporting.text import points
from experiments.studies.claims import recordings
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import PATH, Recording, digest, read
from experiments.studies.claims.piece import CONFIRMATORY
from experiments.studies.claims.random_effects import (
    of_laboratory,
    random_effects,
)
from experiments.studies.claims.rules import NO, UNDECIDED, YES

RULES_3 = PATH.with_name("rules_3.yaml")
NOT_MEASURED = "not measured yet"
NO_EVIDENCE = "no evidence: saturated, too few frames, or one resample"


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
    """Rules 3; errors as of :func:`frozen.read`."""
    return read(RULES_3, Rules)


class Measured(NamedTuple):
    """Bits minus greys on one recording after n frames of each class: mean and its variance, which
    is NaN of a single draw."""

    laboratory: str
    value: float
    variance: float
    n: int


class Verdict(NamedTuple):
    """A word with both intervals that it needs."""

    word: str
    equal: Estimate
    random: Estimate
    units: int


def entering(evidence: Evidence) -> dict[str, pd.DataFrame]:
    """The rows of each recording of the rules that was measured by their split."""
    frozen = rules()
    found = {}
    for scene, rows in evidence.scenes(frozen.experiment).items():
        listed = frozen.recordings.get(scene)
        known = listed is not None and recordings.is_split(rows, listed)
        if known and fields_of(rows) == frozen.input_fields:
            found[scene] = rows
    return found


def measured(evidence: Evidence, model: str = "") -> dict[str, Measured]:
    """A model, by default the bits, minus the greys on each recording, by name."""
    frozen = rules()
    found = {}
    for scene in entering(evidence):
        every = evidence.accuracies(frozen.experiment)[scene]
        form = model or frozen.bits
        compared = recordings.compare(every, form, frozen.greys, "full", frozen)
        if compared is not None:
            laboratory = frozen.recordings[scene].laboratory
            mean = float(np.mean(compared.by_unit))
            (n,) = compared.sizes
            found[scene] = Measured(laboratory, mean, compared.variance, n)
    return found


def missing(evidence: Evidence) -> list[str]:
    """Recordings of the rules on which the two families were not asked yet: before that there is no
    verdict across laboratories."""
    frozen = rules()
    every, there = evidence.accuracies(frozen.experiment), entering(evidence)
    both = {frozen.bits, frozen.greys}
    return [
        scene
        for scene in frozen.recordings
        if scene not in there or not both <= set(every[scene].models)
    ]


def confirmed(evidence: Evidence) -> dict[str, Estimate]:
    """Bits minus greys on each confirmatory recording, with the interval over its test objects."""
    rows = entering(evidence)
    return {
        scene: over_objects(_by_object(rows[scene], one.n))
        for scene, one in measured(evidence).items()
        if rules().recordings[scene].status == CONFIRMATORY
    }


def _beside() -> list[str]:
    """Models that are shown without a verdict."""
    return [model for models in rules().beside.values() for model in models]


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


def over_objects(counts: np.ndarray) -> Estimate:
    """The mean difference of frames, with the central 95 % of resampled objects.

    Args:
        counts: of each test object, right of bits minus right of greys, and frames, [M, 2].
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


# As a table ---------------------------------------------------------------------------------------


def contest(frame: pd.DataFrame) -> pd.DataFrame:
    """The verdict, without each laboratory, of each alone, of other models; measured or not."""
    evidence = Evidence(frame)
    bits = measured(evidence)
    listed = rules().recordings
    complete = not missing(evidence)
    rows = [_row("bits", "all laboratories", bits, judged=complete)]
    by_laboratory: dict[str, list[str]] = {}
    for scene, each in listed.items():
        by_laboratory.setdefault(each.laboratory, []).append(scene)
    for name, scenes in by_laboratory.items():
        own = {scene: bits[scene] for scene in scenes if scene in bits}
        others = {scene: bits[scene] for scene in bits if own and scene not in own}
        why = {} if verdict(own) else _why_none(evidence, scenes)
        rows.append(_row("bits", f"without {name}", others, judged=complete) | why)
        rows.append(_row("bits", f"{name} alone", own) | why)
    by_objects = confirmed(evidence)
    for scene, each in listed.items():
        if each.status == CONFIRMATORY:
            why = {} if scene in by_objects else _why_none(evidence, [scene])
            rows.append(_by_objects(scene, by_objects.get(scene)) | why)
    rows += [
        _row(model, "all laboratories", measured(evidence, model))
        for model in _beside()
    ]
    return pd.DataFrame(rows)


def _row(
    model: str, what: str, found: dict[str, Measured], judged: bool = False
) -> dict[str, Any]:
    """A model minus the greys over the laboratories of some recordings."""
    row: dict[str, Any] = {"model": model, "what": what}
    whole = verdict(found)
    if whole is None:
        return row
    row |= {"laboratories": whole.units, **whole.equal.columns("equal")}
    row |= whole.random.columns("random")
    return {**row, "word": whole.word} if judged else row  # no word on a part of them


def _why_none(evidence: Evidence, scenes: Sequence[str]) -> dict[str, Any]:
    """Why recordings have no number, if both families were asked on one of them."""
    frozen = rules()
    every = evidence.accuracies(frozen.experiment)
    entered = [every[scene].models for scene in scenes if scene in entering(evidence)]
    asked = [{frozen.bits, frozen.greys} <= set(models) for models in entered]
    return {"status": NO_EVIDENCE} if any(asked) else {}


def _by_objects(scene: str, difference: Estimate | None) -> dict[str, Any]:
    """The verdict on a confirmatory recording, by its own interval."""
    row: dict[str, Any] = {"model": "bits", "what": f"{scene}, by test objects"}
    if difference is not None:
        row |= difference.columns("equal") | {"word": word_of(difference)}
    return row


def _name(model: str) -> str:
    return display_name(rules().bits if model == "bits" else model)


def _points(name: str) -> Callable[[Row], str]:
    def cell(row: Row) -> str:
        if row.get("equal") is None:
            return row.get("status") or NOT_MEASURED
        return Column("", points).text(name, row)

    return cell


def _note(_: pd.DataFrame) -> str:
    frozen = rules()
    return (
        f"“{frozen.claim}”: yes where the lower ends of both intervals over laboratories lie above "
        f"{points(-frozen.margin)} points, no where both upper ends lie below. Equal weights: a "
        "laboratory is one value, Student. Without one laboratory: decides nothing. By test "
        "objects: a recording that no model had classified, the central 95 % of resampled objects. "
        "A recording of one resample enters nothing: its variance is unknown. Other models have no "
        "verdict; each has the recordings on which it was asked. "
        f"Rules: {RULES_3.name}, version {frozen.version} of {frozen.dated}, digest "
        f"{digest(RULES_3)}."
    )


def _is_measured(frame: pd.DataFrame) -> bool:
    """Whether the records are of recordings of the rules; on others there is no contest."""
    return len(frame) > 0 and not set(rules().recordings).isdisjoint(frame.scene)


TABLE = Table(
    "contest",
    lambda frame: contest(frame) if _is_measured(frame) else None,
    of=("recordings_chosen", "recordings", RUNS),
    title="Bits against grey values, each family choosing its form: accuracy of bits minus greys",
    shown=("model", "what", "equal", "random", "laboratories", "word"),
    columns={
        "model": Column("Model", _name),
        "what": Column("Recordings"),
        "equal": Column("Equal weights, points [95 %]", cell=_points("equal")),
        "random": Column("Random effects, points [95 %]", cell=_points("random")),
        "laboratories": Column("Laboratories", "{:.0f}".format),
        "word": Column("Verdict"),
    },
    note=_note,
    key=("model", "what"),
    commands=[f"{RUN}recordings_chosen"],
)
