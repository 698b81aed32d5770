"""Every training time relative to HDC in the same implementation: Table I's own from its runs, the
others from ``times_grid``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.records.results import RUNS, of_experiment
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import median_range
from experiments.reporting.facets import intervals
from experiments.reporting.plot import handle, legend_below, look_of
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import ENDS, Table
from experiments.reporting.table import frame as table_of
from experiments.reporting.text import interval, number, percent, two_digits
from experiments.reporting.trained import split_of
from experiments.studies.table1 import tables
from experiments.studies.table1.tables import on_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

NAME = "times_grid"
OF = (RUNS, NAME)
DEFAULT = "default"  # of model=NAME: the runs of Table I
WAYS = {
    "libraries": "standard libraries",
    DEFAULT: "by default",
    "tuned": "tuned",
}
MODELS = ("hdc", "softmax", "softmax_dual", "ridge", "cnn1", "cnn3")
Line = dict[str, Any]


def grid(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per implementation and model, HDC first.

    ``seconds`` is the median over ``runs``, each of a seed of its own; ``ratio`` that of the ratios
    to HDC of the same seed, between order statistics ``ratio_low`` and ``ratio_high`` that hold it
    with probability ``coverage``. A training that never got there counts as infinitely long;
    ``at_least`` is then the ratio of the time that it was given. ``command`` and ``record`` say
    where it is from.
    """
    found = [*_of_runs(of_experiment(frame, RUNS)), *_measured(frame)]
    ways, names = list(WAYS), list(MODELS)
    found.sort(key=lambda line: (ways.index(line["way"]), names.index(line["model"])))
    return table_of(found)


def _of_runs(runs: pd.DataFrame) -> Iterator[Line]:
    """Rows of the runs of Table I."""
    if not len(runs):
        return
    every = on_scene(runs)
    for model in MODELS:
        own = every[every.model == model]
        hdc_s = own.training_time_s if model == "hdc" else own.get("beside.hdc_s")
        if not len(own) or hdc_s is None or hdc_s.isna().all():
            continue
        line = _line(DEFAULT, model, own.training_time_s, own.total_time_s, hdc_s)
        ends = "at_target" if own.iterative.iloc[0] else "final"
        for name in ("train_accuracy", "test_accuracy"):
            line[name] = float(own[f"{name}_{ends}"].mean())
        first = own.iloc[0]
        line |= {"split": split_of(own), "origin": first.origin}
        yield line | {"command": first.command, "record": "records.jsonl"}


def _measured(frame: pd.DataFrame) -> Iterator[Line]:
    """Rows of the other implementations, on the experiment's own frames."""
    rows = of_experiment(frame, NAME)
    if not len(rows):
        return
    own = rows[~rows.elsewhere.astype(bool) & (rows.way != DEFAULT)]
    for (way, model), part in own.groupby(["way", "model"]):
        seconds = part.seconds.astype(float).fillna(math.inf)
        trained = part.trained_s if "trained_s" in part else seconds
        line = _line(way, model, seconds, trained, part.hdc_seconds)
        for name in ("train_accuracy", "test_accuracy"):
            line[name] = float(part[name].mean())
        first = part.iloc[0]
        line |= {"split": split_of(part), "origin": first.origin}
        yield line | {"command": first.command, "record": first.record}


def _line(
    way: str, model: str, seconds: pd.Series, trained: pd.Series, hdc_s: pd.Series
) -> Line:
    """A row without accuracies: times of a model, and of HDC beside each."""
    known = hdc_s.notna()
    ratios = (seconds / hdc_s)[known].tolist()
    ratio, coverage = median_range(ratios)
    line: Line = {"way": way, "model": model, "scene": tables.scene()}
    line |= {"seconds": float(np.median(seconds)), **ratio.columns("ratio")}
    line |= {"at_least": None, "runs": len(ratios), "coverage": coverage}
    if ratio.value == math.inf:
        line["at_least"] = float((trained / hdc_s)[known].median())
    return line


def _seconds(line: Mapping[str, Any]) -> str:
    return number(line["seconds"]) if np.isfinite(line["seconds"]) else "not reached"


def _ratio(line: Mapping[str, Any]) -> str:
    """Two digits with the interval; the bound of a training that never got there."""
    if line["at_least"] is not None:
        return f"> {two_digits(line['at_least'])}"
    return interval(*(two_digits(line[f"ratio{end}"]) for end in ENDS))


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A group of points per implementation, a point per model; an arrow from the least that the
    ratio of a training can be that never got there."""
    axes = figure.subplots()
    others = data[data.model != "hdc"]
    known = others[np.isfinite(others.ratio.astype(float))]
    ways, names = list(data.way.unique()), list(others.model.unique())
    place: Any = {"by": "way", "hue": "model", "names": ways, "hues": names}
    place |= {"apart": (len(names) - 1) / 8, "upright": True}

    def look(model: str) -> dict[str, Any]:
        return {**look_of(model), "ls": "", "ms": 4.5, "elinewidth": 1}

    intervals(axes, known, "ratio", look=look, **place)
    bounded = others[others.at_least.notna() & ~others.index.isin(known.index)]
    arrows = bounded.assign(
        at_least_low=bounded.at_least, at_least_high=1.6 * bounded.at_least
    )
    intervals(
        axes, arrows, "at_least", look=lambda m: {**look(m), "lolims": True}, **place
    )
    colour = look_of("hdc")["color"]
    axes.axhline(1, color=colour, lw=0.8)
    axes.text(-0.57, 1.12, "HDC", color=colour, fontsize=6)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda ratio, _: f"{ratio:,g}")
    axes.set_ylabel("training time relative to HDC")
    axes.set_xticks(range(len(ways)), [WAYS.get(way, way) for way in ways])
    axes.set_xlim(-0.6, len(ways) - 0.4)
    legend_below(figure, map(handle, names))


TABLE = Table(
    NAME,
    grid,
    of=OF,
    key=("way", "model"),
    title="Training times relative to HDC in the same implementation, simulated frames",
    note="Time until training accuracy exceeds 90 %; of ridge regression and converged softmax "
    "until they are solved. Default: the runs of Table I. Standard libraries: the fastest route "
    "found, PyTorch at its defaults. Tuned: compiled kernels, products of bytes, bfloat16. "
    "Relative time: median over runs, a seed each, of the ratio to HDC in the same "
    "implementation, trained before and after. Brackets contain the median with the coverage "
    "that the CSV has. A training that ended before it reached 90 % gives a lower bound.",
    shown=(
        *("way", "model", "seconds", "ratio", "runs"),
        *("train_accuracy", "test_accuracy"),
    ),
    columns={
        "way": Column("Implementation", lambda way: WAYS.get(way, way)),
        "model": Column("Model", display_name),
        "seconds": Column("Time, s", cell=_seconds, of_machine=True),
        "ratio": Column("Relative to HDC [interval]", cell=_ratio),
        "runs": Column("Runs"),
        "train_accuracy": Column("Training accuracy reached, %", percent),
        "test_accuracy": Column("Test accuracy there, %", percent),
    },
    commands=(f"{RUN}table1", f"{RUN}{NAME}"),
)
FIGURE = Figure(
    NAME,
    TABLE,
    draw,
    title="Training time relative to HDC in the same implementation",
    caption="Training time relative to HDC in the same implementation, simulated frames: median "
    "over runs and its interval; the line marks HDC. Arrow: at least, since no training reached "
    "90 %.",
)
