"""The grid of times as a table and a figure: models relative to HDC in the same implementation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.reporting.columns import Column, display_name
from experiments.reporting.measured import ENDS
from experiments.reporting.plot import handle, head, look_of, style_of
from experiments.reporting.study import Plot
from experiments.reporting.table import Table, records
from experiments.reporting.text import interval, number, percent, two_digits
from experiments.studies.table1.times import grid

NOTE = (
    "Time until training accuracy exceeds 90 %; of ridge regression and converged softmax until "
    "they are solved. Default: the runs of Table I. Standard libraries: the fastest route found, "
    "PyTorch at its defaults. Tuned: compiled kernels, products of bytes, bfloat16. Relative time: "
    "median over runs, a seed each, of the ratio to HDC in the same implementation, trained before "
    "and after. Brackets contain the median with the coverage that the CSV has. A training that "
    "ended before it reached 90 % gives a lower bound."
)


def _seconds(line: Mapping[str, Any]) -> str:
    return number(line["seconds"]) if np.isfinite(line["seconds"]) else "not reached"


def _ratio(line: Mapping[str, Any]) -> str:
    """Two digits with the interval; the bound of a training that never got there."""
    if line["at_least"] is not None:
        return f"> {two_digits(line['at_least'])}"
    return interval(*(two_digits(line[f"ratio{end}"]) for end in ENDS))


def draw(figure: Figure, frame: pd.DataFrame) -> None:
    """A group of points a way, a point a model."""
    axes = figure.subplots()
    lines = records(grid.grid(frame))
    ways = list(dict.fromkeys(line["way"] for line in lines))
    models = [m for m in dict.fromkeys(line["model"] for line in lines) if m != "hdc"]
    for line in lines:
        if line["model"] != "hdc" and np.isfinite(line["ratio"]):
            aside = (models.index(line["model"]) - len(models) / 2) / 8
            _draw_ratio(axes, ways.index(line["way"]) + aside, line)
    axes.axhline(1, color=style_of("hdc")[0], lw=0.8)
    axes.text(-0.57, 1.12, "HDC", color=style_of("hdc")[0], fontsize=6)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda ratio, _: f"{ratio:,g}"))
    axes.set_ylabel("training time relative to HDC")
    names = [grid.WAYS.get(way, way) for way in ways]
    axes.set_xticks(range(len(ways)), names)
    axes.set_xlim(-0.6, len(ways) - 0.4)
    head(figure, "Training time relative to HDC in the same implementation", [])
    handles = [handle(model) for model in models]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


def _draw_ratio(axes: Axes, place: float, line: Mapping[str, Any]) -> None:
    """A point with its interval, if it has one."""
    ratio = line["ratio"]
    ends = (line["ratio_low"], line["ratio_high"])
    low, high = (ratio if end is None else end for end in ends)
    bars = np.array([[ratio - low], [high - ratio]])
    look: Any = {**look_of(line["model"]), "ls": "", "ms": 4.5, "elinewidth": 1}
    axes.errorbar([place], [ratio], yerr=bars, **look)


TABLES = [
    Table(
        grid.NAME,
        grid.grid,
        of=grid.OF,
        title="Training times relative to HDC in the same implementation, {frames}. {machine}",
        note=NOTE,
        key=("way", "model"),
        shown=(
            *("way", "model", "seconds", "ratio", "runs"),
            *("train_accuracy", "test_accuracy"),
        ),
        columns={
            "way": Column("Implementation", lambda way: grid.WAYS.get(way, way)),
            "model": Column("Model", display_name),
            "seconds": Column("Time, s", cell=_seconds),
            "ratio": Column("Relative to HDC [interval]", cell=_ratio),
            "runs": Column("Runs"),
            "train_accuracy": Column("Training accuracy reached, %", percent),
            "test_accuracy": Column("Test accuracy there, %", percent),
        },
    )
]
FIGURES = [
    Plot(
        grid.NAME,
        draw,
        of=grid.OF,
        caption="Training time relative to HDC in the same implementation, {frames}: median over "
        "runs and its interval; the line marks HDC.",
        size=(3.4, 2.6),
        needs=lambda lines: {*grid.grid(lines).model} > {"hdc"},
    )
]
