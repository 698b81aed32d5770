"""Evidence from recordings: accuracy with many and with few frames, objects; simulated scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.groups import Groups
from experiments.reporting import published
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import difference
from experiments.reporting.measured import fields_of, over_units, place_of
from experiments.reporting.study import RUN
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Recording, Rules
from experiments.studies.claims.piece import (
    Piece,
    least_variance,
    piece_of,
    variance_of,
)
from experiments.studies.claims.rules import rule_of
from experiments.studies.recordings.values import Accuracies

PUBLISHED = "published"  # a baseline that is a number of the paper
_OBJECTS = "tactile/test_accuracy"


class Sizes(Protocol):
    """Rules that say at which sizes models are compared."""

    @property
    def sizes(self) -> Mapping[str, tuple[int, ...]]: ...

    @property
    def saturated(self) -> float: ...


class Compared(NamedTuple):
    """A model minus another on one recording.

    Attributes:
        by_unit: a difference for each seed or draw, mean over the sizes.
        sizes: training frames of each class.
        n_test: test frames of a seed or draw.
        seeds: whether the units are seeds.
    """

    by_unit: list[float]
    sizes: list[int]
    n_test: float
    seeds: bool

    @property
    def variance(self) -> float:
        """Of their mean."""
        return variance_of(self.by_unit, self.n_test, self.seeds)


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """A piece for each baseline and recording that is listed, or is a listed fibre through more
    input fields; then simulated scenes."""
    every = evidence.accuracies(claim.experiment)
    found = evidence.scenes(claim.experiment)
    for rival in frozen.rivals_of(name):
        for scene, rows in found.items():
            if not claim.recordings or scene in claim.recordings:
                yield from _piece(name, claim, frozen, rival, rows, every[scene])
        if not claim.recordings and claim.sizes == "full":
            runs = Groups.of(evidence.frame)
            yield from _simulated(name, claim, frozen, rival, runs)


def _piece(
    name: str,
    claim: Claim,
    frozen: Rules,
    rival: str,
    rows: pd.DataFrame,
    every: Accuracies,
) -> Iterator[Piece]:
    """Evidence of one recording, if there is any."""
    scene = str(rows.scene.iloc[0])
    recording = frozen.recordings.get(scene)
    if recording is None and fields_of(rows) == frozen.input_fields:
        return
    form = frozen.forms[claim.form]
    compared = compare(every, form, rival, claim.sizes, frozen)
    if compared is None:
        return
    value = over_units(compared.by_unit, compared.seeds)
    remark = _remark(rows, recording, frozen)
    more: dict[str, Any] = {}
    if recording is not None:
        listed = ("laboratory", "frames", "status")
        more = {key: getattr(recording, key) for key in listed}
    if rival == PUBLISHED:
        more["possible"] = (-_of_the_paper(), 1 - _of_the_paper())
    of_units = "seeds" if compared.seeds else "draws"
    sizes = " and ".join(map(str, compared.sizes))
    yield piece_of(
        rows,
        name,
        rival,
        f"{display_name(form)} minus {_rival_name(rival)}",
        value,
        variance=compared.variance,
        n=f"{len(compared.by_unit)} {of_units}, {sizes} frames per class",
        word=rule_of(claim.rule, frozen).of_one(value),
        enters=not remark,
        remark=remark,
        command=f"{RUN}{claim.experiment} scene={scene}",
        **more,
    )


def _remark(rows: pd.DataFrame, recording: Recording | None, frozen: Rules) -> str:
    """Why a recording enters nothing; nothing of one that enters."""
    fields = fields_of(rows)
    if fields != frozen.input_fields:
        return f"seen through {fields} input fields"
    if recording is not None and not is_split(rows, recording):
        return "another split than that of the rules"
    return ""


def _rival_name(rival: str) -> str:
    return "the paper's 100 %" if rival == PUBLISHED else display_name(rival)


def is_split(rows: pd.DataFrame, recording: Recording) -> bool:
    """Whether the record says that the split that counts is that of the rules."""
    splits = rows.config.iloc[0].get("splits") or {}
    counts = splits.get("counts") or {}
    return all(counts.get(key) == value for key, value in recording.split.items())


def compare(
    every: Accuracies, form: str, rival: str, sizes: str, frozen: Sizes
) -> Compared | None:
    """A form minus its baseline at the sizes of this name; None where one of them was not measured,
    where the sizes cannot be filled, and where both are saturated."""
    models = [form] if rival == PUBLISHED else [form, rival]
    if not set(models) <= set(every.models):
        return None
    wanted = frozen.sizes[sizes]
    complete = _complete(every, models, wanted)
    if sizes == "few":
        chosen = list(wanted) if len(complete) == len(wanted) else []
    else:
        chosen = _largest_open(complete, frozen.saturated)
    if not chosen:
        return None
    less = np.mean([_less(complete[n]) for n in chosen], axis=0)
    return Compared(less.tolist(), chosen, every.n_test[form], every.seeds)


def _complete(
    every: Accuracies, models: Sequence[str], sizes: Sequence[int]
) -> dict[int, np.ndarray]:
    """Accuracies at those sizes, [model, unit], that no unit lacks in which one of the models was
    asked at any size."""
    at = {n: np.stack([every.by_unit(m, n) for m in models]) for n in every.sizes}
    asked = ~np.isnan(np.concatenate([*at.values()])).all(axis=0)
    found = {n: at[n][:, asked] for n in sizes if n in at}
    return {n: units for n, units in found.items() if not np.isnan(units).any()}


def _largest_open(complete: Mapping[int, np.ndarray], saturated: float) -> list[int]:
    """The largest size at which a model is below the accuracy that counts as saturated."""
    for n in sorted(complete, reverse=True):
        if complete[n].mean(axis=1).min() < saturated:
            return [n]
    return []


def _less(units: np.ndarray) -> np.ndarray:
    """A form minus its baseline, or minus the paper's accuracy, a number per unit."""
    if len(units) == 1:
        return units[0] - _of_the_paper()
    return units[0] - units[1]


def _of_the_paper() -> float:
    """The accuracy that the paper reports for touched objects."""
    return published.numbers()[_OBJECTS].value / 100


def _simulated(
    name: str, claim: Claim, frozen: Rules, rival: str, runs: Groups
) -> Iterator[Piece]:
    """HDC minus its baseline on simulated scenes, on the same test samples; they enter nothing."""
    form = frozen.forms[claim.form]
    scenes = {group.scene for group in runs}
    for scene in sorted(scenes, key=lambda scene: (place_of(scene), scene)):
        shown = configs.scene_display(scene)
        groups = [runs.group(scene, model) for model in (form, rival)]
        value = difference(*(group.runs for group in groups))
        if shown["kind"] != SIMULATED or value is None:
            continue
        remark = ""
        if scene in frozen.fitted:
            remark = "fitted to HDC's own accuracy"
        elif all(group.right.mean() >= frozen.saturated for group in groups):
            remark = "saturated"
        yield Piece(
            name,
            rival,
            scene,
            str(shown["family"]),
            SIMULATED,
            f"{display_name(form)} minus {display_name(rival)}",
            value,
            least_variance(value.value, len(groups[0].right)),
            n=f"{len(groups[0].runs)} seeds",
            word="" if remark else rule_of(claim.rule, frozen).of_one(value),
            enters=not remark,
            remark=remark,
            command=f"{RUN}all_scenes scene={scene}",
            record="records.jsonl",
        )
