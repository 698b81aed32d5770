"""Measurements that are repeated: over seeds, or over draws of one recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records import configs
from experiments.reporting.estimates import (
    Estimate,
    are_of_one_recording,
    mean_interval,
)

RIVAL = "softmax_dual"  # the first of the primary ones: the paper's own, at its optimum
LEAST_RESAMPLES = 10  # of one recording; the ends of fewer are no interval


def place_of(scene: str) -> tuple[float, str]:
    """Key for sorting scenes: their place among the others, then their name."""
    return float(configs.scene_display(scene)["order"]), scene


def models_of(rows: pd.DataFrame) -> list[str]:
    """The models of some rows: HDC first, then the primary baseline, then others in their order."""
    first = ("hdc", RIVAL)
    models = [str(model) for model in rows["model"].unique()]
    front = [model for model in first if model in models]
    return [*front, *(model for model in models if model not in first)]


def seeds_are_units(rows: pd.DataFrame) -> bool:
    """Whether there are several seeds, each of another sensor, input field or fibre. Seeds of one
    camera's recording only draw other frames of it, as more resamples do."""
    several = rows.seed.nunique() > 1
    return bool(several and not ("origin" in rows and are_of_one_recording(rows)))


def over_units(values: Sequence[float], seeds: bool) -> Estimate:
    """Mean with Student's interval over seeds. Resamples of one recording share frames: their
    interval is their central 95 %, and there is none of fewer than LEAST_RESAMPLES."""
    if seeds:
        return mean_interval(list(values))
    if len(values) < LEAST_RESAMPLES:
        return Estimate(float(np.mean(values)))
    low, high = np.quantile(values, (0.025, 0.975))
    mean = float(np.mean(values))
    return Estimate(mean, float(low), float(high))


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each split, model, n and unit: ``accuracy``. The unit is the seed where seeds are
    units, else the resample."""
    unit = rows.seed
    if not seeds_are_units(rows):
        unit = rows.seed * (1 + rows.draw.max()) + rows.draw
    every = rows[["split", "model", "n"]].assign(
        unit=unit, accuracy=rows.right / rows.n_test
    )
    by_unit = every.groupby(["split", "model", "n", "unit"])
    return by_unit.accuracy.mean().reset_index()


def matrices(rows: pd.DataFrame, kind: str, samples: str) -> NDArray[np.float64]:
    """Correlation matrices of a measurement, a matrix per seed: [seeds, L, L]."""
    chosen = rows[(rows.kind == kind) & (rows.samples == samples)]
    n_classes = chosen.class_i.nunique()
    # Rows are in the order in which they were made: by seed, row and column of the matrix.
    return chosen.value.to_numpy(float).reshape(-1, n_classes, n_classes)


def mean_matrix(rows: pd.DataFrame, kind: str, samples: str) -> pd.DataFrame:
    """The mean over seeds of a correlation matrix, a row per pair: ``class_i``, ``class_j``,
    ``value``."""
    chosen = rows[(rows.kind == kind) & (rows.samples == samples)]
    by_pair = chosen.groupby(["class_i", "class_j"], sort=False)
    return by_pair["value"].mean().reset_index()
