"""Accuracies on recordings, what each change of the model costs, and errors and run times."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import pandas as pd

from experiments.records import configs
from experiments.records.results import by_scene, of_experiment
from experiments.reporting.columns import (
    Column,
    display_name,
    milliseconds,
    scene_name,
)
from experiments.reporting.estimates import Estimate
from experiments.reporting.forms import FORMS
from experiments.reporting.resamples import (
    accuracies,
    models_of,
    over_units,
    seeds_are_units,
)
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import (
    kind_of,
    percent,
    points,
    size,
    two_digits,
)

FEW = 5  # frames per class


def recordings(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each recording by its scene."""
    return by_scene(of_experiment(frame, "recordings"))


class Accuracies:
    """Accuracies on one recording by the split that counts, a row per unit and a column per model.

    Attributes:
        sizes: frames per class at which some model was asked, increasing.
        models: names, in the order of the rows.
    """

    def __init__(self, of_recording: pd.DataFrame) -> None:
        rows = of_recording[of_recording.split == "counts"]
        self.models = [str(model) for model in rows.model.unique()]
        self._seeds = seeds_are_units(rows)  # otherwise draws of one recording
        every = accuracies(rows)
        self.sizes: list[int] = sorted(every.n.unique().tolist())
        asked = ["n", "model"]
        self._table = every.pivot(index="unit", columns=asked, values="accuracy")

    def mean(self, model: str, n: int) -> Estimate:
        """Mean accuracy with its interval; NaN where the model was not asked."""
        return self._estimate(self._table.get((n, model)))

    def pair(self, first: str, second: str, n: int) -> pd.DataFrame:
        """Accuracies of two models in the units in which both were asked."""
        of_size = self._table.get(n, pd.DataFrame())
        return of_size.reindex(columns=[first, second]).dropna()

    def difference(self, first: str, second: str, n: int) -> Estimate:
        """How much more accurate one model is than another in the same units."""
        both = self.pair(first, second, n)
        return self._estimate(both[first] - both[second])

    def _estimate(self, by_unit: pd.Series | None) -> Estimate:
        values = [] if by_unit is None else by_unit.dropna().tolist()
        return over_units(values, self._seeds) if values else Estimate(math.nan)


NOTE = (
    "Split by time, session, group or position, as each data set states, so that near "
    "copies of a test frame do not train. Brackets: Student over seeds (input fields, "
    "fibres) for fibres, the central 95 % of at least ten resamples for cameras, each of "
    "which is one sensor. Standardised: each frame with mean 0 and deviation 1. Networks are "
    "not judged on these data sets."
)
ABOUT = {
    "recording": Column("Data set", scene_name),
    "kind": Column("Kind"),
    "frames": Column("Frames"),
    "n": Column("Frames per class"),
}


# Accuracies ---------------------------------------------------------------------------------------


def front(frame: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each model by recording and frames per class."""
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, rows in recordings(frame).items():
        models |= dict.fromkeys(models_of(rows))
        about = {"recording": scene, "kind": kind_of(str(rows.origin.iloc[0]))}
        about["frames"] = configs.scene_display(scene)["frames"]
        every = Accuracies(rows)
        for n in every.sizes:
            line: dict[str, Any] = {**about, "n": n}
            for model in every.models:
                mean = every.mean(model, n)
                if not math.isnan(mean.value):
                    line |= mean.columns(model)
            table.append(line)
    bounds = [name + end for name in models for end in ENDS[1:]]
    data = pd.DataFrame(table)
    return data[[name for name in [*ABOUT, *models, *bounds] if name in data]]


def _recording_at(row: Mapping[str, Any]) -> str:
    """A recording and how many frames of each class train."""
    return f"{scene_name(row['recording'])}, n = {row['n']}"


# One change after the other -----------------------------------------------------------------------


class Step(NamedTuple):
    """One change, and the two models that differ by it."""

    name: str
    before: str
    after: str


STEPS = (
    Step("grey values to one bit", "lda_greys", "hdc_lda"),
    Step("LDA to majority: as published", "hdc_lda", "hdc"),
    Step("aside: one bit to seven", "hdc_lda", "hdc_levels_lda"),
    Step("aside: one bit to seven, by deviation", "hdc_lda", "hdc_deviation_lda"),
)
"""From LDA of standardised grey values to HDC as published, and two steps aside."""


def decomposition(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording and step whose two models were asked, at the most frames."""
    table: list[dict[str, Any]] = []
    for scene, rows in recordings(frame).items():
        every = Accuracies(rows)
        n = every.sizes[-1]
        for step in STEPS:
            line = {"recording": scene, "n": n, "step": step.name}
            change = every.difference(step.after, step.before, n)
            table.append(line | change.columns("change"))
    return pd.DataFrame(table).dropna(subset="change")


# Errors and run times -----------------------------------------------------------------------------

COSTS_OF = ("recording_costs", "recordings")
TIMES = ("fit", "predict_frame")


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording, number of frames and model: error, stored bytes, seconds by NumPy
    and by the compiled kernels, and the smaller of both."""
    parts = list(by_scene(of_experiment(frame, "recording_costs")).values())
    if not parts:
        return pd.DataFrame()
    data = pd.concat(parts).rename(columns={"scene": "recording"})
    known = {scene: Accuracies(rows) for scene, rows in recordings(frame).items()}
    data["bits"] = 8 * data.bytes / data.n_pixels / data.n_classes
    data["error"] = [
        1 - known[scene].mean(model, n).value if scene in known else math.nan
        for scene, model, n in zip(data.recording, data.model, data.n, strict=True)
    ]
    columns = ["recording", "n", "model", "bytes", "bits", "error"]
    for time in TIMES:
        both = [f"{time}_s", f"{time}_compiled_s"]
        data = data.reindex(columns=[*data, *set(both) - set(data)])
        data[f"{time}_best_s"] = data[both].min(axis="columns")
        columns += [*both, f"{time}_best_s"]
    return data[columns]


def at_most_frames(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of :func:`costs` with an error at the most frames per class of a recording."""
    known = costs(frame)
    if not len(known):
        return known
    known = known.dropna(subset="error")
    return known[known.n == known.groupby("recording").n.transform("max")]


TABLES = [
    Table(
        "recordings",
        front,
        of="recordings",
        title="Accuracy on public data sets",
        note=NOTE,
        key=("recording", "n"),
        columns={**ABOUT, "recording": Column("Data set", cell=_recording_at)},
        shown=("recording", *FORMS),
    ),
    Table(
        "decomposition",
        decomposition,
        of="recordings",
        title="Where HDC loses accuracy: one change of the model after the other",
        columns={
            "recording": ABOUT["recording"],
            "n": ABOUT["n"],
            "step": Column("Step"),
            "change": Column("Change, percentage points", points),
        },
        note=f"{NOTE} Every step changes the encoder or the read-out alone; at the most frames per "
        "class.",
        key=("recording", "step"),
    ),
    Table(
        "recording_costs",
        costs,
        of=COSTS_OF,
        title="Error and run time on public data sets",
        columns={
            "recording": ABOUT["recording"],
            "n": ABOUT["n"],
            "model": Column("Model", display_name),
            "error": Column("Error, %", percent),
            "fit_best_s": Column("Training, s", of_machine=True),
            "predict_frame_best_s": Column(
                "Prediction, ms per frame", milliseconds, of_machine=True
            ),
            "bytes": Column("To predict", size),
            "bits": Column("Bits per pixel and class", two_digits),
        },
        shown=(
            *("recording", "n", "model", "error", "fit_best_s", "predict_frame_best_s"),
            *("bytes", "bits"),
        ),
        note="To predict: the bytes that a prediction needs; a file has more. Times: one "
        "process, frames in memory and nothing computed of them before, the least of several "
        "interleaved repetitions, by the compiled kernels where they are faster than NumPy; "
        "prediction in batches of 100 frames. Error: by the held-out split, mean over the same "
        "draws for all models.",
        key=("recording", "n", "model"),
    ),
]
