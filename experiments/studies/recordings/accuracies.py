"""Accuracies on recordings and their differences, as tables, figures and claims need them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records.results import by_scene, of_experiment
from experiments.reporting.estimates import Estimate
from experiments.reporting.resamples import accuracies, over_units, seeds_are_units

FEW = 5  # frames per class


def recordings(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each recording by its scene."""
    return by_scene(of_experiment(frame, "recordings"))


class Accuracies:
    """Accuracies on one recording by the split that counts, a row per unit and a column per model.

    Attributes:
        sizes: frames per class at which some model was asked, increasing.
        models: names, in the order of the rows.
        seeds: whether units are seeds, not draws of one recording.
        units: draws or seeds, in rising order.
    """

    def __init__(self, of_recording: pd.DataFrame) -> None:
        rows = of_recording[of_recording.split == "counts"]
        self.models = [str(model) for model in rows.model.unique()]
        self.seeds = seeds_are_units(rows)
        every = accuracies(rows)
        self.sizes: list[int] = sorted(every.n.unique().tolist())
        asked = ["model", "n"]
        self._table = every.pivot(index="unit", columns=asked, values="accuracy")
        self.units: list[Any] = self._table.index.tolist()

    def by_unit(self, model: str, n: int) -> NDArray[np.float64]:
        """Accuracy in each unit, [units]; NaN where the model was not asked."""
        if (model, n) not in self._table:
            return np.full(len(self.units), math.nan)
        return self._table[model, n].to_numpy(float)

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

    def _estimate(self, by_unit: NDArray[np.float64]) -> Estimate:
        values = by_unit[~np.isnan(by_unit)].tolist()
        return over_units(values, self.seeds) if values else Estimate(math.nan)
