"""The grid of times as a table and a figure: models relative to HDC in the same implementation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.measured import ENDS
from experiments.reporting.plot import handle, head, literal, look_of, style_of
from experiments.reporting.study import RUN, Plot
from experiments.reporting.table import Table, records, text_of
from experiments.reporting.text import (
    frames_of,
    interval,
    number,
    percent,
    split_name,
    two_digits,
)
from experiments.studies.table1 import models
from experiments.studies.table1.times import grid

NOTE = (
    "Time until training accuracy exceeds 90 %; of ridge regression and converged softmax until "
    "they are solved. Default: the runs of Table I. Standard libraries: the fastest route found, "
    "PyTorch at its defaults. Tuned: compiled kernels, products of bytes, bfloat16. Relative time: "
    "median over runs, a seed each, of the ratio to HDC in the same implementation, trained before "
    "and after. Brackets contain the median with the coverage that the CSV has. A training that "
    "ended before it reached 90 % gives a lower bound."
)


COMMANDS = (f"{RUN}table1", f"{RUN}{grid.NAME}")


def _text(text: str) -> Callable[[pd.DataFrame], str]:
    """A text with the frames and the machine of the lines on the scene of Table I alone."""
    return lambda lines: text_of(text, _own(lines))


def _own(lines: pd.DataFrame) -> pd.DataFrame:
    return lines[lines.scene == models.scene()]


def _seconds(line: Mapping[str, Any]) -> str:
    return number(line["seconds"]) if np.isfinite(line["seconds"]) else "not reached"


def _ratio(line: Mapping[str, Any]) -> str:
    """Two digits with the interval; the bound of a training that never got there."""
    if line["at_least"] is not None:
        return f"> {two_digits(line['at_least'])}"
    return interval(*(two_digits(line[f"ratio{end}"]) for end in ENDS))


def draw(figure: Figure, frame: pd.DataFrame) -> None:
    """A group of points per implementation, a point per model."""
    axes = figure.subplots()
    lines = records(grid.grid(frame))
    ways = list(dict.fromkeys(line["way"] for line in lines))
    others = [m for m in dict.fromkeys(line["model"] for line in lines) if m != "hdc"]
    for line in lines:
        if line["model"] != "hdc":
            aside = (others.index(line["model"]) - (len(others) - 1) / 2) / 8
            _draw_ratio(axes, ways.index(line["way"]) + aside, line)
    axes.axhline(1, color=style_of("hdc")[0], lw=0.8)
    axes.text(-0.57, 1.12, "HDC", color=style_of("hdc")[0], fontsize=6)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda ratio, _: f"{ratio:,g}"))
    axes.set_ylabel("training time relative to HDC")
    names = [grid.WAYS.get(way, way) for way in ways]
    axes.set_xticks(range(len(ways)), names)
    axes.set_xlim(-0.6, len(ways) - 0.4)
    own = _own(frame)
    frames = frames_of(own.to_dict("records"))
    about = [literal(scene_name(models.scene())), frames, _split(own)]
    text = "Training time relative to HDC in the same implementation"
    head(figure, text, [", ".join(filter(None, about))])
    handles = [handle(model) for model in others]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


def _split(lines: pd.DataFrame) -> str:
    """The split of some lines, in words."""
    return split_name(lines.config.iloc[0].get("split") or {})


def _draw_ratio(axes: Axes, place: float, line: Mapping[str, Any]) -> None:
    """A point with its interval, if it has one; of a training that never got there an arrow from
    the least that the ratio can be."""
    look: Any = {**look_of(line["model"]), "ls": "", "ms": 4.5, "elinewidth": 1}
    ratio, least = line["ratio"], line["at_least"]
    if not np.isfinite(ratio):
        if least is not None:
            axes.errorbar([place], [least], yerr=[0.6 * least], lolims=True, **look)
        return
    ends = (line["ratio_low"], line["ratio_high"])
    low, high = (ratio if end is None else end for end in ends)
    bars = np.array([[ratio - low], [high - ratio]])
    axes.errorbar([place], [ratio], yerr=bars, **look)


TABLES = [
    Table(
        grid.NAME,
        grid.grid,
        of=grid.OF,
        title=_text(
            "Training times relative to HDC in the same implementation, {frames}. {machine}"
        ),
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
        commands=COMMANDS,
    )
]
FIGURES = [
    Plot(
        grid.NAME,
        draw,
        of=grid.OF,
        caption=_text(
            "Training time relative to HDC in the same implementation, {frames}: median over "
            "runs and its interval; the line marks HDC. Arrow: at least, since no training "
            "reached 90 %."
        ),
        size=(3.4, 2.6),
        needs=lambda lines: {*grid.grid(lines).model} > {"hdc"},
        commands=COMMANDS,
    )
]
