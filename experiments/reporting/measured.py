"""Shared by studies of measurements: by scene, over seeds or resamples, as matrices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records import configs
from experiments.records.results import by_scene
from experiments.records.rows import unpack_labels
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.text import CAPTURED, kind_of

RIVAL = "softmax_dual"  # the first of the primary ones: the paper's own, at its optimum
ENDS = ("", "_low", "_high")  # of the columns of a value and its bounds
LEAST_RESAMPLES = 10  # of one recording; the ends of fewer are no interval


def each_scene(
    make: Callable[[pd.DataFrame], pd.DataFrame], rows: pd.DataFrame
) -> pd.DataFrame:
    """Results of a function of the rows of each scene, one below the other, with ``scene``."""
    parts = []
    for scene, of_scene in by_scene(rows).items():
        made = make(of_scene).copy()  # what is made once belongs to everybody
        if len(made):
            made.insert(0, "scene", scene)
            parts.append(made)
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def values_of(data: pd.DataFrame) -> list[str]:
    """Names of the columns of a table that are no bounds."""
    return [str(name) for name in data if not str(name).endswith(ENDS[1:])]


def place_of(scene: str) -> float:
    """The place of a scene among the others."""
    return float(configs.scene_display(scene)["place"])


def saturated(rows: pd.DataFrame) -> bool:
    """Whether the frames of one scene cannot tell models apart, as its config says."""
    return bool(_scene_of(rows).get("saturated"))


def fields_of(rows: pd.DataFrame) -> int:
    """How many input fields of a fibre a frame of one scene shows side by side; 1 of any other."""
    return int(_scene_of(rows).get("n_fields", 1))


def _scene_of(rows: pd.DataFrame) -> dict[str, Any]:
    return rows.config.iloc[0].get("scene") or {}


def models_of(rows: pd.DataFrame) -> list[str]:
    """The models of some rows: HDC first, then the primary baseline, then others in their order."""
    first = ("hdc", RIVAL)
    models = [str(model) for model in rows["model"].unique()]
    front = [model for model in first if model in models]
    return [*front, *(model for model in models if model not in first)]


def seeds_are_units(rows: pd.DataFrame) -> bool:
    """Whether there are several seeds, each of another sensor, input field or fibre. Those of one
    camera's recording draw other frames of it, as more resamples do."""
    several = rows.seed.nunique() > 1
    return bool(several and not ("origin" in rows and _is_captured(rows)))


def _is_captured(rows: pd.DataFrame) -> bool:
    return kind_of(str(rows.origin.iloc[0])) == CAPTURED


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


def with_right(rows: pd.DataFrame, resample: Sequence[str]) -> pd.DataFrame:
    """The rows with ``right``, how many predictions are right at each n of a row.

    Rows keep what was predicted and, once a resample, the true classes, or ``right`` itself.
    """
    if "right" in rows:
        return rows
    right = [
        [int((unpack_labels(text) == truth).sum()) for text in texts]
        for texts, truth in zip(rows.predicted, truths(rows, resample), strict=True)
    ]
    return rows.assign(right=right)


def truths(rows: pd.DataFrame, resample: Sequence[str]) -> pd.Series:
    """The true classes of the test samples of each row, int [Q].

    Args:
        rows: of a study that compares models.
        resample: columns that are equal for the rows of one resample.
    """
    of_resample = rows.groupby(list(resample)).labels
    return of_resample.transform("first").map(unpack_labels)


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each split, model, n and unit: ``accuracy``. The unit is the seed where seeds are
    units, else the resample."""
    counted = with_right(rows, ("seed", "split", "draw"))
    unit = counted.seed
    if not seeds_are_units(counted):
        unit = counted.seed * (1 + counted.draw.max()) + counted.draw
    needed = counted[["split", "model", "n", "right", "n_test"]].assign(unit=unit)
    every = needed.explode(["n", "right"]).astype({"n": int, "right": float})
    every["accuracy"] = every.right / every.n_test
    by_unit = every.groupby(["split", "model", "n", "unit"])
    return by_unit.accuracy.mean().reset_index()


def matrices(
    rows: pd.DataFrame, kind: str, samples: str
) -> tuple[list[str], NDArray[np.float64], int]:
    """Correlation matrices of a measurement: classes, C [seeds, L, L], samples per class."""
    chosen = rows[(rows.kind == kind) & (rows.samples == samples)]
    classes = list(chosen.class_i.unique())
    # Rows are in the order in which they were made: by seed, row and column of the matrix.
    values = chosen.value.to_numpy(float).reshape(-1, len(classes), len(classes))
    return classes, values, int(chosen.n.iloc[0])
