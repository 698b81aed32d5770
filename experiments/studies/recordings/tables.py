"""Accuracies on recordings, what each change of the model costs, and errors beside run times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
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
from experiments.reporting.resamples import RIVAL, models_of, saturated
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import (
    kind_of,
    number,
    percent,
    points,
    size,
    two_digits,
)
from experiments.studies.recordings.accuracies import (
    CONFIRMATORY,
    RIVALS,
    Accuracies,
    recordings,
    unsaturated,
)

NOTE = (
    "Split by time, session, group or position, as each recording states, so that near "
    "copies of a test frame do not train. Brackets: Student over seeds (input fields, "
    "fibres) for fibres, the central 95 % of at least ten resamples for cameras, each of "
    "which is one sensor. Standardised: each frame with mean 0 and deviation 1. Captured: "
    "by a camera; computed: from measured matrices of a fibre, with an assumed noise. "
    f"Primary baselines: {display_name(RIVAL)}, on raw and on standardised frames."
)
ABOUT = {
    "recording": Column("Recording", scene_name),
    "kind": Column("Kind"),
    "frames": Column("Frames"),
    "n": Column("Frames per class"),
    "told": Column("Solved by a low-resolution baseline"),
}
# Models that see no speckle, and what it means where one of them is ahead of HDC.
TRIVIAL = {"brightness": "brightness", "thumbnail": "coarse layout"}


# Accuracies ---------------------------------------------------------------------------------------


def front(frame: pd.DataFrame) -> pd.DataFrame:
    """The recordings, at the fewest, five and the largest number of frames per class."""
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, rows in recordings(frame).items():
        models |= dict.fromkeys(models_of(rows))
        about = _about(scene, rows)
        for line in _by_size(Accuracies(rows)):
            table.append({"recording": scene, **about, **line})
            about = {"kind": "", "frames": ""}
    data = pd.DataFrame(table)
    bounds = [name + end for name in models for end in ENDS[1:]]
    names = [*ABOUT, *models, *bounds]
    return data[[name for name in names if name in data]]


def _about(scene: str, rows: pd.DataFrame) -> dict[str, str]:
    """The kind of the frames, and what they are."""
    frames = configs.scene_display(scene)["frames"]
    if saturated(rows):
        frames += "; saturated, ranks nothing"
    return {"kind": kind_of(str(rows.origin.iloc[0])), "frames": frames}


def _by_size(every: Accuracies) -> Iterator[dict[str, Any]]:
    """Accuracies by the split that counts at the fewest, five and the most frames per class."""
    for n in every.ends():
        line: dict[str, Any] = {"n": n, "told": _told(every, n)}
        for model in every.models:
            mean = every.mean(model, n)
            if not math.isnan(mean.value):
                line |= mean.columns(model)
        yield line


def _told(every: Accuracies, n: int) -> str:
    """Which trivial models are ahead of HDC, and whether one is ahead of every other model."""
    ahead = [model for model in TRIVIAL if every.difference(model, "hdc", n).low > 0]
    if not ahead:
        return ""
    called = " and ".join(TRIVIAL[model] for model in ahead)
    text = f"{called} alone: more than HDC"
    leads = any(_leads(every, model, n) for model in ahead)
    return f"{text}, and than any model here" if leads else text


def _leads(every: Accuracies, model: str, n: int) -> bool:
    """Whether no other model is more accurate in the draws in which both were asked."""
    others = (every.difference(other, model, n).value for other in every.models)
    return not any(more > 0 for more in others)


def _values_of(data: pd.DataFrame) -> list[str]:
    return [str(name) for name in data if not str(name).endswith(ENDS[1:])]


def _columns(data: pd.DataFrame) -> dict[str, Column]:
    """How the columns are shown: what a row is of, and a column per model."""
    models = [name for name in _values_of(data) if name not in ABOUT]
    return ABOUT | {m: Column(f"{display_name(m)}, %", percent) for m in models}


def _shown(data: pd.DataFrame) -> list[str]:
    """The recording, then HDC as published and extended, the baseline and other models.

    Of these, models with an interval come first: others learnt from a few of the draws only.
    """
    first = ("recording", "n", "told", *CONFIRMATORY, *RIVALS)
    others = [name for name in _values_of(data) if name not in (*first, *ABOUT)]
    low = data.reindex(columns=[name + ENDS[1] for name in others])
    others = [others[k] for k in low.isna().sum().argsort(kind="stable")]
    return [*(name for name in first if name in data), *others]


# One change after the other -----------------------------------------------------------------------


class Step(NamedTuple):
    """One change, and the two models that differ by it."""

    name: str
    before: str
    after: str


STEPS = (
    Step("threshold: greys to bits", "ridge_standardised", "linear_bits"),
    Step("ridge to lda (4-bit weights)", "linear_bits", "hdc_lda"),
    Step("lda to class means: equal weights", "hdc_lda", "hdc_integer"),
    Step("mean to majority: one bit", "hdc_integer", "hdc"),
    Step("aside: prototype to nearest frame", "hdc", "nearest_neighbour"),
)
"""From ridge regression of grey values to HDC as published, and one step aside."""


def decomposition(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording and step whose two models were asked, at the most frames."""
    table: list[dict[str, Any]] = []
    for scene, rows in unsaturated(frame).items():
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

COSTS_OF = ("recording_costs", "recordings", "recordings_chosen")
TIMES = ("fit", "predict_frame")


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording, number of frames and model: stored bytes, seconds by NumPy and by
    the compiled kernels, and by the faster of both relative to converged softmax."""
    table = []
    timed, *asked = (by_scene(of_experiment(frame, name)) for name in COSTS_OF)
    for scene, rows in timed.items():
        found = [Accuracies(lines[scene]) for lines in asked if scene in lines]
        for row in rows.to_dict("records"):
            model, n = row["model"], row["n"]
            line = {"recording": scene, "n": n, "model": model, "bytes": row["bytes"]}
            line["bits"] = 8 * row["bytes"] / row["n_pixels"] / row["n_classes"]
            line["error"] = _error(found, model, n)
            for time in TIMES:
                by_numpy, compiled = row[f"{time}_s"], row.get(f"{time}_compiled_s")
                line |= {f"{time}_s": by_numpy, f"{time}_compiled_s": compiled}
                line[f"{time}_best_s"] = np.nanmin([by_numpy, compiled or math.nan])
            table.append(line)
    data = pd.DataFrame(table)
    return _relative(data) if len(data) else data


def _error(every: Sequence[Accuracies], model: str, n: int) -> float:
    """Mean test error of a model after n frames of each class; NaN where it is unknown.

    A draw of one experiment is that of another: the same frames. Errors are those of the draws that
    all experiments have, for one draw of a few objects can be far easier than another.
    """
    asked = [set(one.units) for one in every if n in one.sizes]
    shared = list(set.intersection(*asked)) if asked else []
    for one in every:
        accuracies = one.by_unit(model, n)[np.isin(one.units, shared)]
        known = accuracies[~np.isnan(accuracies)]
        if len(known):
            return 1 - float(known.mean())
    return math.nan


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
        note=f"{NOTE} Solved by a low-resolution baseline: where two numbers of a frame, its mean "
        "and deviation (brightness), or a picture of 8 × 6 pixels (coarse layout) recognise more "
        "than HDC, the interval of the difference above zero. Such frames differ by more than "
        "their fine pattern. Networks stop after a limited number of steps, torchhd's "
        "classifiers learn on hypervectors of this library's encoder.",
        key=("recording", "n"),
        columns=_columns,
        shown=_shown,
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
        note=f"{NOTE} All steps are on the same bits but the first. The last one is aside: nearest "
        "neighbour keeps every training frame in place of one prototype per class.",
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
    "converged softmax on grey values. Error: by the split that counts, on the draws on which "
    "forms were chosen, the same for all models; those that take long had fewer of them.",
    key=("recording", "n", "model"),
)
TABLES.append(COSTS)
