"""Costs of the models of a recording, beside their errors."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.results import of_scenes, once
from experiments.reporting.columns import (
    Column,
    display_name,
    milliseconds,
    scene_name,
)
from experiments.reporting.curves import plain_decades
from experiments.reporting.labels import name_points
from experiments.reporting.plot import LETTERS, head, literal, panel
from experiments.reporting.study import Plot
from experiments.reporting.table import Table, records
from experiments.reporting.text import number, percent, size, two_digits
from experiments.studies.recordings.values import (
    FEW,
    SPLIT,
    of_recording,
    recordings,
    unsaturated,
)

OF = ("recording_costs", "recordings", "recordings_chosen")
NOT_MEASURED = "not measured yet"
COMPARED = {
    "hdc": "published form",
    "hdc_levels_lda": "extended form",
    "hdc_deviation_lda": "deviations and LDA",
    "hdc_levels_kernel": "levels and kernel",
    "bits_chosen": "bits, form chosen",
    "greys_chosen": "greys, form chosen",
}
USUAL = (
    *("softmax_dual", "softmax_dual_standardised", "softmax_chosen"),
    *("ridge", "ridge_standardised", "knn_greys", "mean_image", "thumbnail"),
)
"""Baselines of which the one of least error stands in the table, which favours it."""
TIMES = ("fit", "predict_frame")
PACE = "softmax_dual"
"""Converged softmax on grey values, which run times are relative to."""
GOAL = 1.5
"""Times of :data:`PACE` that a form with a linear read-out may take to train and to predict."""


class Errors:
    """Test errors on one recording, by the split that counts, whichever experiment has them.

    A draw of one experiment is that of the other: the same frames. Errors are those of the draws
    that both have, for one draw of a few objects can be far easier than another.
    """

    def __init__(self, frame: pd.DataFrame, scene: str) -> None:
        found = (of_scenes(frame, name).get(scene) for name in OF[1:])
        self.parts = [of_recording(rows) for rows in found if rows is not None]

    def of(self, model: str, n: int) -> float:
        """Mean test error of a model after n frames of each class; NaN where it is unknown."""
        shared = self._shared(n)
        for part in self.parts:
            accuracies = part.by_unit(model, n)[np.isin(part.units, shared)]
            known = accuracies[~np.isnan(accuracies)]
            if len(known):
                return 1 - float(known.mean())
        return math.nan

    def _shared(self, n: int) -> list[Any]:
        """The draws, or seeds, of all experiments that were asked with n frames of each class."""
        every = [set(part.units) for part in self.parts if n in part.sizes]
        return list(set.intersection(*every)) if every else []

    def largest(self) -> int:
        """The most frames of each class."""
        return max((part.sizes[-1] for part in self.parts if part.sizes), default=0)

    def best(self, n: int) -> str:
        """The usual baseline of least error; the first where none is known."""
        errors = {model: self.of(model, n) for model in USUAL}
        known = {model: of for model, of in errors.items() if not math.isnan(of)}
        return min(known, key=lambda model: known[model], default=USUAL[0])


@once
def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording, number of frames and model."""
    table = []
    for scene, rows in of_scenes(frame, OF[0]).items():
        errors = Errors(frame, scene)
        for row in rows.to_dict("records"):
            model, n = row["model"], row["n"]
            line = {"recording": scene, "n": n, "model": model, "bytes": row["bytes"]}
            line["bits"] = 8 * row["bytes"] / row["n_pixels"] / row["n_classes"]
            line["error"] = _known(errors.of(model, n))
            table.append(line | _times(row))
    return pd.DataFrame(table)


def _times(row: Mapping[str, Any]) -> dict[str, Any]:
    """Seconds by NumPy and by the compiled kernels."""
    names = [f"{time}{by}_s" for by in ("", "_compiled") for time in TIMES]
    return {name: _known(row.get(name, math.nan)) for name in names}


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


# One table per size -------------------------------------------------------------------------------


def compared(frame: pd.DataFrame, few: bool) -> pd.DataFrame:
    """A row for each recording and model that is compared, measured or not."""
    names = ["bytes", *_times({})]
    unknown: dict[str, Any] = dict.fromkeys(names)
    found = {
        (row["recording"], row["n"], row["model"]): {name: row[name] for name in names}
        for row in records(costs(frame))
    }
    table = []
    for scene in unsaturated(recordings(frame)):
        errors = Errors(frame, scene)
        n = FEW if few else errors.largest()
        roles = {**COMPARED, errors.best(n): "best usual baseline"}
        pace = found.get((scene, n, PACE), unknown)
        for model, role in roles.items():
            line = {"recording": scene, "n": n, "role": role, "model": model}
            line["error"] = _known(errors.of(model, n))
            measured = found.get((scene, n, model), unknown)
            table.append({**line, **measured, **_relative(measured, pace)})
    return pd.DataFrame(table)


def _relative(row: Mapping[str, Any], pace: Mapping[str, Any]) -> dict[str, Any]:
    """Run times, each by the faster implementation, relative to converged softmax."""
    found = {}
    for time in TIMES:
        own, other = _fastest(row, time), _fastest(pace, time)
        found[f"{time}_relative"] = own / other if own and other else None
    return found


def _fastest(row: Mapping[str, Any], time: str) -> float | None:
    """Seconds by NumPy or by the compiled kernels, whichever are fewer; None: not measured."""
    times = [row[f"{time}_s"], row[f"{time}_compiled_s"]]
    return min((seconds for seconds in times if seconds is not None), default=None)


def _of_either(time: str, show: Any) -> Any:
    """Text of a time by NumPy, and by the compiled kernels where the model has them."""

    def cell(row: Mapping[str, Any]) -> str:
        by_numpy, compiled = row.get(f"{time}_s"), row.get(f"{time}_compiled_s")
        if by_numpy is None:
            return NOT_MEASURED
        text = show(by_numpy)
        return text if compiled is None else f"{text}; compiled {show(compiled)}"

    return cell


def _or_not(name: str, show: Any) -> Any:
    def cell(row: Mapping[str, Any]) -> str:
        value = row.get(name)
        return NOT_MEASURED if value is None else show(value)

    return cell


COLUMNS = {
    "recording": Column("Recording", scene_name),
    "n": Column("Frames per class"),
    "role": Column("Role"),
    "model": Column("Model", display_name),
    "error": Column("Error, %", cell=_or_not("error", percent)),
    "fit_s": Column("Training, s", cell=_of_either("fit", number)),
    "predict_frame_s": Column(
        "Prediction, ms per frame", cell=_of_either("predict_frame", milliseconds)
    ),
    "bytes": Column("Stored", cell=_or_not("bytes", size)),
}
SHOWN = ("recording", "model", *list(COLUMNS)[4:])
RELATIVE = {
    f"{time}_relative": Column(
        f"{head}, relative to softmax", cell=_or_not(f"{time}_relative", number)
    )
    for time, head in zip(TIMES, ("Training", "Prediction"), strict=True)
}
NOTE = (
    "Stored: all that a prediction needs. Times: one process, frames in memory and "
    "nothing computed of them before, the least of several interleaved repetitions; by "
    "NumPy, and by the compiled kernels where the model has them; prediction in batches "
    "of 100 frames. Training of a chosen form includes the choice. Error: by the split "
    "that counts, on the draws on which forms were chosen, the same for all models; those "
    "that take long had fewer of them."
)
_PACE = (
    " Relative to softmax: by the faster implementation, over converged softmax on grey values. "
    f"The goal is {GOAL:g} for forms with a linear read-out; a kernel compares each frame with "
    "all training frames, and has no goal."
)
_BEST = " The last model of each recording is the usual baseline of least error, which favours it."


# Error against time -------------------------------------------------------------------------------


def is_on_front(times: Sequence[float], errors: Sequence[float]) -> list[bool]:
    """Whether no other point has less time and less error, or as much of one and less of the
    other."""
    points = np.stack([times, errors], axis=1)
    found = []
    for point in points:
        no_worse = (points <= point).all(axis=1)
        better = (points < point).any(axis=1)
        found.append(not (no_worse & better).any())
    return found


def _shown(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows at the most frames, of recordings that can tell models apart, with known errors; times
    in seconds and milliseconds by the faster way."""
    table = costs(frame)
    if not len(table):
        return table
    table = table[table.recording.isin(list(unsaturated(recordings(frame))))]
    most = table.groupby("recording").n.transform("max")
    known = table[table.n == most].dropna(subset="error")
    fastest = {
        time: known[[f"{time}_s", f"{time}_compiled_s"]].astype(float).min(axis=1)
        for time in TIMES
    }
    milli = 1e3 * fastest["predict_frame"]
    return known.assign(error=100 * known.error, fit=fastest["fit"], frame_ms=milli)


def error_against_time(figure: Figure, frame: pd.DataFrame) -> None:
    """A row per recording: error against training time, and against time per frame."""
    table = _shown(frame)
    scenes = list(table.recording.unique())
    figure.set_size_inches(7.0, 1.0 + 1.7 * len(scenes))
    panels = figure.subplots(len(scenes), 2, sharex="col", sharey="row", squeeze=False)
    for letter, (left, right), scene in zip(LETTERS, panels, scenes, strict=False):
        rows = table[table.recording == scene]
        _draw(left, rows, "fit")
        _draw(right, rows, "frame_ms")
        panel(left, letter, f"{literal(scene_name(scene))}, n = {rows.n.iloc[0]}")
        left.set_ylabel("test error (%)")
        left.set_ylim(bottom=-0.04 * rows.error.max())  # shows a whole marker at zero
    panels[-1, 0].set_xlabel("training (s)")
    panels[-1, 1].set_xlabel("prediction (ms per frame)")
    handles = [Line2D([], [], ls="", **look) for look in _LOOKS.values()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    details = [f"{SPLIT}; named: models on the front"]
    head(figure, "Test error against run time, by recording", details)
    figure.draw_without_rendering()  # names need the final layout
    for line, scene in zip(panels, scenes, strict=True):
        rows = table[table.recording == scene]
        for axes, key in zip(line, ("fit", "frame_ms"), strict=True):
            _name_front(axes, rows, key)


# What the figure tells apart; points on the front have their names.
_LOOKS: dict[str, dict[str, Any]] = {
    "hdc": {"marker": "o", "color": "#D55E00", "label": "HDC, published"},
    "forms": {"marker": "D", "color": "#E69F00", "label": "HDC, other forms"},
    "softmax_dual": {
        "marker": "s",
        "color": "#0072B2",
        "label": display_name("softmax_dual"),
    },
    "others": {"marker": "^", "color": "0.6", "label": "other models"},
}


def _kind_of(model: str) -> str:
    """The entry of the legend that a model has."""
    if model in _LOOKS:
        return model
    return "forms" if model.startswith(("hdc", "bits")) else "others"


def _draw(axes: Axes, rows: pd.DataFrame, key: str) -> None:
    """A marker per model; those on the front are joined."""
    for row in rows.to_dict("records"):
        axes.plot(row[key], row["error"], ls="", ms=4, **_LOOKS[_kind_of(row["model"])])
    on_front = is_on_front(rows[key].tolist(), rows.error.tolist())
    front = rows[on_front].sort_values(key)
    axes.step(
        front[key], front.error, where="post", color="0.6", lw=1.0, zorder=0, marker=""
    )
    axes.set_xscale("log")
    plain_decades(axes)
    axes.grid(color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def _name_front(axes: Axes, rows: pd.DataFrame, key: str) -> None:
    """The names of the models on the front, each beside its marker."""
    on_front = is_on_front(rows[key].tolist(), rows.error.tolist())
    models = enumerate(zip(rows.model, on_front, strict=True))
    names = {k: display_name(model) for k, (model, named) in models if named}
    name_points(axes, rows[[key, "error"]], names)


def _tables() -> Iterator[Table]:
    yield Table(
        "recording_costs",
        costs,
        of=OF,
        title="Stored bytes and times, and the errors that they buy",
        columns={**COLUMNS, "bits": Column("Bits per pixel and class", two_digits)},
        shown=("recording", "n", *SHOWN[1:], "bits"),
        note=NOTE,
        key=("recording", "n", "model"),
    )
    for name, few in (("costs_few", True), ("costs_many", False)):
        at = f"{FEW} frames per class" if few else "the most frames per class"
        yield Table(
            name,
            functools.partial(compared, few=few),
            of=OF,
            title=f"Error and run time at {at}",
            columns=COLUMNS | RELATIVE,
            shown=(*SHOWN, *RELATIVE),
            note=NOTE + _BEST + _PACE,
            key=("recording", "role"),
        )


TABLES = list(_tables())
FIGURES = [
    Plot(
        "recordings_error_vs_time",
        error_against_time,
        of=OF,
        caption="Test error against training time, and against time per frame, at the "
        "most frames per class, one row per recording, with compiled kernels if "
        "they are faster. Grey: the front, where no other model has less of both.",
        size=(7.0, 3.4),
        needs=lambda frame: len(_shown(frame)) > 0,
    )
]
