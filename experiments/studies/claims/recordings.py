"""Evidence from recordings: accuracy with many and with few frames, objects; simulated scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.results import of_scenes
from experiments.reporting import published
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import difference
from experiments.reporting.measured import accuracies, fields_of, over_units
from experiments.reporting.study import RUN
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.frozen import Claim, Recording, Rules
from experiments.studies.claims.piece import (
    Piece,
    least_variance,
    place_of,
    variance_of,
)
from experiments.studies.claims.rules import rule_of

PUBLISHED = "published"  # a baseline that is a number of the paper
_OBJECTS = "tactile/test_accuracy"


class Sizes(Protocol):
    """Rules that say at which sizes models are compared."""

    @property
    def sizes(self) -> Mapping[str, tuple[int, ...]]: ...

    @property
    def saturated(self) -> float: ...


class Compared(NamedTuple):
    """HDC minus a baseline on one recording.

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


def pieces(
    name: str, claim: Claim, frozen: Rules, frame: pd.DataFrame
) -> Iterator[Piece]:
    """A piece for each baseline and recording that is listed, or is a listed fibre through more
    input fields; then simulated scenes."""
    found = of_scenes(frame, claim.experiment)
    runs = Groups.of(frame)
    for rival in frozen.rivals_of(name):
        for scene in sorted(found, key=_place):
            if claim.recordings and scene not in claim.recordings:
                continue
            piece = _piece(name, claim, frozen, rival, found[scene])
            if piece is not None:
                yield piece
        if not claim.recordings and claim.sizes == "full":
            yield from _simulated(name, claim, frozen, rival, runs)


def _place(scene: str) -> tuple[float, str]:
    return float(configs.scene_display(scene)["place"]), scene


def listed(scene: str, frozen: Rules) -> Recording | None:
    """Entry of a recording in the rules; None of one that is not listed."""
    return frozen.recordings.get(scene)


def _piece(
    name: str,
    claim: Claim,
    frozen: Rules,
    rival: str,
    rows: pd.DataFrame,
) -> Piece | None:
    """Evidence of one recording; None where there is none."""
    scene = str(rows.scene.iloc[0])
    recording = listed(scene, frozen)
    if recording is None and fields_of(rows) == frozen.input_fields:
        return None
    form = frozen.forms[claim.form]
    compared = compare(rows, form, rival, claim, frozen)
    if compared is None:
        return None
    value = over_units(compared.by_unit, compared.seeds)
    variance = variance_of(compared.by_unit, compared.n_test, compared.seeds)
    remark = _remark(rows, recording, frozen)
    shown = configs.scene_display(scene)
    possible = (-1.0, 1.0)
    if rival == PUBLISHED:
        possible = (-_of_the_paper(), 1 - _of_the_paper())
    of_units = "seeds" if compared.seeds else "draws"
    sizes = " and ".join(map(str, compared.sizes))
    return Piece(
        name,
        rival,
        scene,
        recording.laboratory if recording else str(shown["family"]),
        recording.frames if recording else str(shown["kind"]),
        f"{display_name(form)} minus {_rival_name(rival)}",
        value,
        variance,
        status=recording.status if recording else "exploratory",
        possible=possible,
        n=f"{len(compared.by_unit)} {of_units}, {sizes} frames per class",
        word=rule_of(claim.rule, frozen).of_one(value),
        enters=not remark,
        remark=remark,
        command=f"{RUN}{claim.experiment} scene={scene}",
        record=place_of(rows),
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
    """Whether the split that counts is that of the rules."""
    splits = rows.config.iloc[0].get("splits") or {}
    counts = splits.get("counts")
    if counts is None:  # a record that does not say
        return True
    return all(counts.get(key) == value for key, value in recording.split.items())


def compare(
    rows: pd.DataFrame, form: str, rival: str, claim: Claim, frozen: Sizes
) -> Compared | None:
    """HDC minus its baseline by the split that counts, at the sizes of a claim; None where one of
    them was not measured, where the sizes cannot be filled, and where both are saturated."""
    models = [form] if rival == PUBLISHED else [form, rival]
    if not set(models) <= set(rows.model):
        return None
    every = accuracies(rows[rows.model.isin(models) | _has_labels(rows)])
    counts = every[(every.split == "counts") & every.model.isin(models)]
    by_model = counts.pivot(index="unit", columns=["model", "n"], values="accuracy")
    units = by_model.dropna(how="all")
    wanted = frozen.sizes[claim.sizes]
    complete = [
        n
        for n in wanted
        if all(
            (model, n) in units and units[model, n].notna().all() for model in models
        )
    ]
    if claim.sizes == "few":
        sizes = list(wanted) if len(complete) == len(wanted) else []
    else:
        sizes = _largest_open(units, models, complete, frozen.saturated)
    if not sizes:
        return None
    less = np.mean([_less(units, models, n) for n in sizes], axis=0)
    of_test = rows[(rows.model == form) & (rows.split == "counts")].n_test
    return Compared(
        less.tolist(), sizes, float(of_test.mean()), rows.seed.nunique() > 1
    )


def _has_labels(rows: pd.DataFrame) -> pd.Series:
    """The rows that hold the true classes of a draw, whichever model they are of."""
    if "labels" not in rows:
        return pd.Series(False, rows.index)
    return rows.labels.notna()


def _largest_open(
    units: pd.DataFrame, models: Sequence[str], sizes: Sequence[int], saturated: float
) -> list[int]:
    """The largest size at which a model is below the accuracy that counts as saturated."""
    for n in sorted(sizes, reverse=True):
        if min(float(units[model, n].mean()) for model in models) < saturated:
            return [n]
    return []


def _less(units: pd.DataFrame, models: Sequence[str], n: int) -> np.ndarray:
    """HDC minus its baseline, or minus the paper's accuracy, a number per unit."""
    of_hdc = units[models[0], n].to_numpy(float)
    if len(models) == 1:
        return of_hdc - _of_the_paper()
    return of_hdc - units[models[1], n].to_numpy(float)


def _of_the_paper() -> float:
    """The accuracy that the paper reports for touched objects."""
    return published.numbers()[_OBJECTS].value / 100


def _simulated(
    name: str, claim: Claim, frozen: Rules, rival: str, runs: Groups
) -> Iterator[Piece]:
    """HDC minus its baseline on simulated scenes, on the same test samples; they enter nothing."""
    form = frozen.forms[claim.form]
    scenes = {group.scene for group in runs}
    for scene in sorted(scenes, key=_place):
        shown = configs.scene_display(scene)
        groups = [runs.group(scene, model) for model in (form, rival)]
        value = difference(*(group.runs for group in groups))
        if shown["kind"] != SIMULATED or value is None:
            continue
        remark = ""
        if scene in frozen.fitted:
            remark = "fitted to HDC's own accuracy"
        elif _saturated(groups, frozen):
            remark = "saturated"
        n_test = len(groups[0].right)
        yield Piece(
            name,
            rival,
            scene,
            str(shown["family"]),
            SIMULATED,
            f"{display_name(form)} minus {display_name(rival)}",
            value,
            least_variance(value.value, n_test),
            n=f"{len(groups[0].runs)} seeds",
            word="" if remark else rule_of(claim.rule, frozen).of_one(value),
            enters=not remark,
            remark=remark,
            command=f"{RUN}all_scenes scene={scene}",
            record="records.jsonl",
        )


def _saturated(groups: Sequence[Group], frozen: Rules) -> bool:
    return all(group.right.mean() >= frozen.saturated for group in groups)
