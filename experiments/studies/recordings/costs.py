"""What a model of a recording costs, and the errors that it buys."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.records.results import of_scenes
from experiments.reporting.columns import (
    Column,
    display_name,
    milliseconds,
    scene_name,
)
from experiments.reporting.curves import plain_decades
from experiments.reporting.plot import LETTERS, handle, look_of, panel, wrapped
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import number, percent, size
from experiments.studies.recordings.panels import grid
from experiments.studies.recordings.values import (
    Accuracies,
    recordings,
    unsaturated,
)


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording and model."""
    errors = recordings(frame)
    table = []
    for scene, rows in of_scenes(frame, "recording_costs").items():
        table += list(_lines(scene, rows, errors.get(scene)))
    return pd.DataFrame(table)


def _lines(
    scene: str, rows: pd.DataFrame, bench: pd.DataFrame | None
) -> Iterator[dict[str, Any]]:
    every = None if bench is None else Accuracies(bench)
    for row in rows.to_dict("records"):
        line = {"recording": scene, "n": row["n"], "model": row["model"]}
        line["bytes"] = row["bytes"]
        line["bits"] = 8 * row["bytes"] / row["n_pixels"] / row["n_classes"]
        error = math.nan
        if every is not None:
            error = 1 - every.mean(row["model"], row["n"]).value
        line["error"] = None if math.isnan(error) else error
        line |= {key: row[key] for key in ("fit_s", "predict_frame_s")}
        yield line


def _shown(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of recordings that can tell models apart and whose errors are known."""
    table = costs(frame)
    if not len(table):
        return table
    known = table[table.recording.isin(list(unsaturated(recordings(frame))))]
    return known.dropna(subset="error")


def error_against_bytes(figure: Figure, frame: pd.DataFrame) -> None:
    """A marker a model."""
    table = _shown(frame)
    scenes = list(table.recording.unique())
    panels, at_the_left = grid(figure, len(scenes), row=1.9, rest=1.0, most=3)
    for letter, axes, scene in zip(LETTERS, panels, scenes, strict=False):
        _points(axes, table[table.recording == scene])
        panel(axes, letter, wrapped(scene_name(scene), 34))
    for axes in at_the_left:
        axes.set_ylabel("error (%)")
    handles = [handle(model) for model in table.model.unique()]
    for entry in handles:
        entry.set_linestyle("")
    where: Any = {"loc": "outside lower center", "ncols": 4}
    figure.legend(handles=handles, **where)


def _points(axes: Axes, rows: pd.DataFrame) -> None:
    for row in rows.to_dict("records"):
        look = {**look_of(row["model"]), "ls": "", "ms": 5}
        axes.plot(row["bytes"] / 1e3, 100 * row["error"], **look)
    axes.set_xscale("log")
    plain_decades(axes)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("stored (kB)")
    axes.grid(color="0.92", lw=0.5)
    axes.set_axisbelow(True)


TABLES = [
    Table(
        "recording_costs",
        costs,
        of=("recording_costs", "recordings"),
        title="Stored bytes, and the errors that they buy",
        columns={
            "recording": Column("Recording", scene_name),
            "n": Column("Frames per class"),
            "model": Column("Model", display_name),
            "bytes": Column("Stored", size),
            "bits": Column("Bits a pixel and class", lambda bits: number(bits, 2)),
            "error": Column("Error, %", percent),
            "fit_s": Column("Training, s"),
            "predict_frame_s": Column("Prediction, ms a frame", milliseconds),
        },
        note="Stored: all that a prediction needs, in bits for each pixel of a frame and each "
        "class beside. Times: of one process, frames in memory and nothing computed of them "
        "before, the least of several; prediction of a batch. Error: by the split that counts.",
        key=("recording", "model"),
        folded=True,
    )
]
FIGURES = [
    Plot(
        "error_vs_bytes",
        error_against_bytes,
        of=("recording_costs", "recordings"),
        caption="Error on test frames against the bytes that a model stores, at the most frames "
        "per class, a panel a recording. Vermilion: forms of HDC; towards the lower left is "
        "better.",
        size=(7.0, 3.4),
        needs=lambda frame: len(_shown(frame)) > 0,
    )
]
