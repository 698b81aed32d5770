"""Accuracies on recordings and their differences, as tables and figures of the study need them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records import configs
from experiments.records.results import of_scenes, once
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import (
    RIVAL,
    accuracies,
    fields_of,
    over_units,
    saturated,
    seeds_are_units,
)
from experiments.reporting.text import kind_of

RIVALS = (RIVAL, "softmax_dual_standardised")
"""Converged softmax regression, of grey values and of standardised frames."""
CONFIRMATORY = ("hdc", "hdc_levels_lda")
"""The forms of HDC that the frozen rules name; every other is exploratory."""
FEW = 5  # frames per class
SPLIT = "test frames of another time, session, group or position than those of training"
NOTE = (
    "Split by time, session, group or position, as each recording states, so that near "
    "copies of a test frame do not train. Brackets: Student over seeds (input fields, "
    "fibres) for fibres, the central 95 % of at least ten resamples for cameras, each of "
    "which is one sensor. Standardised: each frame with mean 0 and deviation 1. Captured: "
    "by a camera; computed: from measured matrices of a fibre, with an assumed noise. "
    f"Primary baselines: {display_name(RIVAL)}, on raw and on standardised frames."
)


def recordings(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each recording by its scene; a fibre counts once, by one input field."""
    found = of_scenes(frame, "recordings").items()
    return {scene: rows for scene, rows in found if fields_of(rows) == 1}


def unsaturated(found: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Those of some recordings that can tell models apart."""
    return {scene: one for scene, one in found.items() if not saturated(one)}


def kind(scene: str, rows: pd.DataFrame) -> str:
    """Captured, computed or simulated: the kind of the frames of a recording."""
    if "origin" in rows:
        return kind_of(str(rows.origin.iloc[0]))
    return str(configs.scene_display(scene)["kind"])


def forms_of(models: Sequence[str]) -> list[str]:
    """Forms of HDC among some models: the published one, then those that go beyond it."""
    every = ("hdc", *configs.models("beyond"))
    confirmed = [name for name in CONFIRMATORY if name in models]
    others = [name for name in every if name in models and name not in confirmed]
    return [*confirmed, *others]


# Accuracies ---------------------------------------------------------------------------------------


class Accuracies:
    """Accuracies on one recording by the split that counts, a row per unit and a column per model.

    Attributes:
        sizes: frames per class at which some model was asked, increasing.
        models: names, in the order of the rows.
        seeds: whether units are seeds, not draws of one recording.
        n_test: test frames of a unit by model.
        units: draws or seeds, in rising order.
    """

    def __init__(self, of_recording: pd.DataFrame) -> None:
        rows = of_recording[of_recording.split == "counts"]
        self.models = [str(model) for model in rows.model.unique()]
        self.seeds = seeds_are_units(rows)
        self.sizes: list[int] = []
        self.n_test: dict[Any, float] = rows.groupby("model").n_test.mean().to_dict()
        self.units: list[Any] = []
        self._by_unit: dict[tuple[str, int], NDArray[np.float64]] = {}
        if len(rows):
            every = accuracies(rows)
            self.sizes = sorted(every.n.unique().tolist())
            asked = ["model", "n"]
            table = every.pivot(index="unit", columns=asked, values="accuracy")
            self.units = table.index.tolist()
            self._by_unit = dict(
                zip(table.columns, table.to_numpy(float).T, strict=True)
            )

    def ends(self) -> list[int]:
        """The fewest frames per class, five, and the most."""
        if not self.sizes:
            return []
        middle = [n for n in self.sizes if n == FEW]
        return list(dict.fromkeys((self.sizes[0], *middle, self.sizes[-1])))

    def by_unit(self, model: str, n: int) -> NDArray[np.float64]:
        """Accuracy in each unit, [units]; NaN where the model was not asked."""
        found = self._by_unit.get((model, n))
        return np.full(len(self.units), math.nan) if found is None else found

    def mean(self, model: str, n: int) -> Estimate:
        """Mean accuracy with its interval; NaN where the model was not asked."""
        return self._estimate(self.by_unit(model, n))

    def pair(self, first: str, second: str, n: int) -> NDArray[np.float64]:
        """Accuracies of two models in the units in which both were asked, [2, units]."""
        both = np.stack([self.by_unit(first, n), self.by_unit(second, n)])
        return both[:, ~np.isnan(both).any(axis=0)]

    def difference(self, first: str, second: str, n: int) -> Estimate:
        """How much more accurate one model is than another in the same units."""
        return self._estimate(self.by_unit(first, n) - self.by_unit(second, n))

    def stronger(self, models: Sequence[str], n: int) -> str | None:
        """The one with the largest mean, which favours it; None where none was asked."""
        means = {name: self.mean(name, n).value for name in models}
        known = {name: value for name, value in means.items() if not math.isnan(value)}
        return max(known, key=lambda name: known[name], default=None)

    def _estimate(self, by_unit: NDArray[np.float64]) -> Estimate:
        values = by_unit[~np.isnan(by_unit)].tolist()
        return over_units(values, self.seeds) if values else Estimate(math.nan)


@once
def of_recording(rows: pd.DataFrame) -> Accuracies:
    """Of one recording."""
    return Accuracies(rows)


def accuracies_of(found: dict[str, pd.DataFrame]) -> dict[str, Accuracies]:
    """Of each recording."""
    return {scene: of_recording(rows) for scene, rows in found.items()}


# Forms of HDC against the baseline ----------------------------------------------------------------


class Gap(NamedTuple):
    """How much more accurate a form of HDC is than a baseline on one recording."""

    form: str
    rival: str
    n: int
    difference: Estimate


def gaps(
    every: Accuracies, n: int, forms: Sequence[str], rivals: Sequence[str]
) -> Iterator[Gap]:
    """Each form minus the stronger of some baselines at n; nothing where either was not asked."""
    rival = every.stronger(rivals, n)
    if rival is None:
        return
    for form in forms:
        difference = every.difference(form, rival, n)
        if not np.isnan(difference.value):
            yield Gap(form, rival, n, difference)
