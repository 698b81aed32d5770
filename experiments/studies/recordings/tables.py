"""Accuracies on recordings, what each change of the model costs, and errors beside run times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import by_scene, of_experiment
from experiments.reporting.columns import (
    Column,
    display_name,
    milliseconds,
    scene_name,
)
from experiments.reporting.forms import FORMS
from experiments.reporting.resamples import RIVAL, models_of
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import (
    kind_of,
    number,
    percent,
    points,
    size,
    two_digits,
)
from experiments.studies.recordings.accuracies import Accuracies, recordings

NOTE = (
    "Split by time, session, group or position, as each recording states, so that near "
    "copies of a test frame do not train. Brackets: Student over seeds (input fields, "
    "fibres) for fibres, the central 95 % of at least ten resamples for cameras, each of "
    "which is one sensor. Standardised: each frame with mean 0 and deviation 1. Networks are "
    "not judged on recordings."
)
ABOUT = {
    "recording": Column("Recording", scene_name),
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
        steps = _steps(Accuracies(rows))
        table += ({"recording": scene, **line} for line in steps)
    return pd.DataFrame(table)


def _steps(every: Accuracies) -> Iterator[dict[str, Any]]:
    for n in every.sizes[-1:]:
        for step in STEPS:
            # One of them may have been asked in fewer draws than the other.
            before, after = every.pair(step.before, step.after, n)
            if len(before):
                yield {
                    "n": n,
                    "step": step.name,
                    "before": step.before,
                    "after": step.after,
                    "before_accuracy": float(before.mean()),
                    "after_accuracy": float(after.mean()),
                    **every.difference(step.after, step.before, n).columns("change"),
                }


# Errors beside run times --------------------------------------------------------------------------

COSTS_OF = ("recording_costs", "recordings")
TIMES = ("fit", "predict_frame")


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording, number of frames and model: error, stored bytes, seconds by NumPy
    and by the compiled kernels, and by the faster of both relative to converged softmax."""
    table = []
    asked = {scene: Accuracies(rows) for scene, rows in recordings(frame).items()}
    for scene, rows in by_scene(of_experiment(frame, "recording_costs")).items():
        for row in rows.to_dict("records"):
            model, n = row["model"], row["n"]
            line = {"recording": scene, "n": n, "model": model, "bytes": row["bytes"]}
            line["bits"] = 8 * row["bytes"] / row["n_pixels"] / row["n_classes"]
            line["error"] = math.nan
            if scene in asked:
                line["error"] = 1 - asked[scene].mean(model, n).value
            for time in TIMES:
                by_numpy, compiled = row[f"{time}_s"], row.get(f"{time}_compiled_s")
                line |= {f"{time}_s": by_numpy, f"{time}_compiled_s": compiled}
                line[f"{time}_best_s"] = np.nanmin([by_numpy, compiled or math.nan])
            table.append(line)
    data = pd.DataFrame(table)
    return _relative(data) if len(data) else data


def _relative(data: pd.DataFrame) -> pd.DataFrame:
    """The rows with run times relative to converged softmax on grey values of the same frames."""
    at = ["recording", "n"]
    pace = data[data.model == RIVAL].set_index(at)
    for time in TIMES:
        best = f"{time}_best_s"
        of_rival = data[at].apply(tuple, axis="columns").map(pace[best])
        data[f"{time}_relative"] = data[best] / of_rival
    return data


def _of_either(time: str, show: Any) -> Any:
    """Text of a time by NumPy, and by the compiled kernels where the model has them."""

    def cell(row: Mapping[str, Any]) -> str:
        text, compiled = show(row[f"{time}_s"]), row.get(f"{time}_compiled_s")
        return text if compiled is None else f"{text}; compiled {show(compiled)}"

    return cell


TABLES = [
    Table(
        "recordings",
        front,
        of="recordings",
        title="Accuracy on public recordings",
        note=NOTE,
        key=("recording", "n"),
        columns={**ABOUT, "recording": Column("Recording", cell=_recording_at)},
        shown=("recording", *FORMS),
    ),
    Table(
        "decomposition",
        decomposition,
        of="recordings",
        title="Where HDC loses its points: accuracy by one change of the model after the other",
        columns={
            "recording": ABOUT["recording"],
            "n": ABOUT["n"],
            "step": Column("Step"),
            "before": Column("From", display_name),
            "after": Column("To", display_name),
            "before_accuracy": Column("From, %", percent),
            "after_accuracy": Column("To, %", percent),
            "change": Column("Change, points", points),
        },
        note=f"{NOTE} Every step changes the encoder or the read-out alone; at the most frames per "
        "class.",
        key=("recording", "step"),
    ),
]
COSTS = Table(
    "recording_costs",
    costs,
    of=COSTS_OF,
    title="Error and run time on recordings",
    columns={
        "recording": ABOUT["recording"],
        "n": ABOUT["n"],
        "model": Column("Model", display_name),
        "error": Column("Error, %", percent),
        "fit_s": Column("Training, s", cell=_of_either("fit", number), of_machine=True),
        "predict_frame_s": Column(
            "Prediction, ms per frame",
            cell=_of_either("predict_frame", milliseconds),
            of_machine=True,
        ),
        "bytes": Column("Stored", size),
        "bits": Column("Bits per pixel and class", two_digits),
    },
    shown=(
        *("recording", "n", "model", "error", "fit_s", "predict_frame_s", "bytes"),
        "bits",
    ),
    note="Stored: all that a prediction needs. Times: one process, frames in memory and nothing "
    "computed of them before, the least of several interleaved repetitions; by NumPy, and by the "
    "compiled kernels where the model has them; prediction in batches of 100 frames. Training of "
    "a chosen form includes the choice. Relative to softmax: by the faster implementation, over "
    "converged softmax on grey values. Error: by the split that counts, mean over the same draws "
    "for all models.",
    key=("recording", "n", "model"),
)
TABLES.append(COSTS)
