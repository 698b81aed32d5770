"""The quantile that was stated, beside the accuracies that were found at each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.curves import errors
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.measured import by_scene, commands_of, saturated, with_right
from experiments.reporting.plot import LETTERS, panel, wrapped
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import percent, points

STUDY = Study(
    "quantiles",
    "The best threshold, stated beforehand",
    "One threshold need not be the median: does theory name the best quantile of a frame from its "
    "dark pixels and its noise, before a frame is classified?",
    2.7,
)
MEDIAN = 0.5
# Words of the table.
PREDICTS = "predicts"
FAILS = "fails"
NO_NEED = "right, as is the median"
SATURATED = "saturated, says nothing"
# Frames per class that the figure shows, with colour and marker.
SIZES = {1: ("#56B4E9", "o"), 5: ("#0072B2", "s"), 20: ("#E69F00", "D")}
NOTE = (
    "Stated from a few training frames of every class, by the share of dark pixels and by how much "
    "the others vary within a class and between two; no frame is classified for it. Means over "
    "seeds; brackets: the least and the largest, of the difference Student over seeds. Best: of "
    "the quantiles that were tried. Theory predicts where the stated quantile is on average at "
    "most {tolerance} points behind and the median is farther; the tolerance was set before an "
    "accuracy was looked at. Error of the law: correlations of bits at other quantiles, as they "
    "follow from those at the median if pixels were Gaussian, less the measured ones; mean "
    "absolute difference over pairs of classes. Without: if they were those at the median."
)


def _hundredths(value: float) -> str:
    return f"{value:.2f}"


@STUDY.table(
    "quantiles",
    key=("recording", "n"),
    title="The quantile that theory states, and the best that was found",
    columns={
        "recording": Column("Recording", scene_name),
        "n": Column("Frames per class"),
        "dark": Column("Dark pixels, %", percent),
        "stated": Column("Stated quantile", _hundredths),
        "best": Column("Best quantile found", "{:g}".format),
        "at_stated": Column("HDC at the stated quantile, %", percent),
        "at_best": Column("HDC at the best, %", percent),
        "at_median": Column("HDC at the median, %", percent),
        "less": Column("Stated less best, points", points),
        "word": Column("Theory"),
        "law_error": Column("Error of the law"),
        "unchanged_error": Column("Error without"),
    },
)
def stated_and_found(results: Results) -> pd.DataFrame | None:
    """A row for each recording and number of frames per class."""
    found = by_scene(results, "quantiles")
    table = [row for scene, one in found.items() for row in _rows(scene, one)]
    if not table:
        return None
    data = pd.DataFrame(table)
    tolerances = [tolerance_of(measured) for measured in found.values()]
    shown = " or ".join(percent(value) for value in dict.fromkeys(tolerances))
    data.attrs["note"] = NOTE.replace("{tolerance}", shown)
    data.attrs["commands"] = [f"{RUN}quantiles scene={scene}" for scene in found]
    return data


def tolerance_of(measured: Measured) -> float:
    """How far behind the best the stated quantile may be, as a share."""
    return float(measured.record.config["tolerance"])


def _rows(scene: str, measured: Measured) -> Iterator[dict[str, Any]]:
    """The rows of one recording."""
    rows = measured.frame
    stated = rows[rows.kind == "predicted"]
    law = rows[(rows.kind == "law") & (rows["at"] != MEDIAN)]
    for n, curve in curves(rows).groupby("n"):
        tried = curve[~curve.stated].pivot(
            index="seed", columns="at", values="accuracy"
        )
        of_stated = curve[curve.stated].set_index("seed").accuracy
        means = tried.mean()
        best = means.idxmax()
        less = mean_interval((of_stated - tried[best]).tolist())
        median_behind = means[best] - means.get(MEDIAN, np.nan)
        word = verdict(-less.value, median_behind, tolerance_of(measured))
        yield {
            "recording": scene,
            "n": n,
            **_spread(stated.dark).columns("dark"),
            **_spread(stated["at"]).columns("stated"),
            "best": best,
            "at_stated": of_stated.mean(),
            "at_best": means[best],
            "at_median": means.get(MEDIAN),
            **less.columns("less"),
            "word": SATURATED if saturated(measured) else word,
            "law_error": law.error.mean(),
            "unchanged_error": law.error_unchanged.mean(),
        }


def verdict(behind: float, median_behind: float, tolerance: float) -> str:
    """Whether the stated quantile is as good as the best, and the median is not.

    Args:
        behind: accuracy at the best quantile less that at the stated one.
        median_behind: the same of the median.
        tolerance: the most that still counts as good as the best.
    """
    if behind > tolerance:
        return FAILS
    return NO_NEED if median_behind <= tolerance else PREDICTS


def curves(rows: pd.DataFrame) -> pd.DataFrame:
    """``seed``, ``n``, ``at``, ``accuracy``, and whether ``at`` is the ``stated`` quantile."""
    asked = with_right(rows[rows.kind == "accuracy"], ("seed",))
    every = asked.explode(["n", "right"]).astype({"n": int, "right": float})
    every["accuracy"] = every.right / every.n_test
    # The stated quantile is asked last, unless it is one of the others.
    last = every.groupby(["seed", "n"], sort=False).cumcount(ascending=False) == 0
    by_seed = rows[rows.kind == "predicted"].set_index("seed")["at"]
    every["stated"] = last & (every["at"] == every.seed.map(by_seed))
    return every[["seed", "n", "at", "accuracy", "stated"]]


def _spread(values: pd.Series) -> Estimate:
    """Mean with the least and the largest value."""
    return Estimate(float(values.mean()), float(values.min()), float(values.max()))


@STUDY.figure(
    "quantiles",
    caption="Accuracy of HDC with a single threshold at different quantiles of the frame, means "
    "over seeds with the least and the largest. Grey: the quantiles that theory stated from the "
    "light of five training frames of every class, before a frame was classified; dotted: the "
    "median.",
    size=(7.0, 2.4),
    needs=lambda results: bool(by_scene(results, "quantiles")),
    commands=lambda results: commands_of(by_scene(results, "quantiles").values()),
)
def accuracy_by_quantile(figure: Figure, results: Results) -> None:
    """A panel per recording, a line per number of frames, the stated quantiles as a band."""
    found = by_scene(results, "quantiles")
    panels = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for letter, axes, (scene, measured) in zip(
        LETTERS, panels, found.items(), strict=False
    ):
        rows = measured.frame
        stated = rows[rows.kind == "predicted"]["at"]
        width = 0.005  # half of a line, where all seeds state the same
        axes.axvspan(
            stated.min() - width, stated.max() + width, color="0.8", lw=0, zorder=0
        )
        axes.axvline(MEDIAN, color="0.4", lw=0.7, ls=":", zorder=0)
        _draw_curves(axes, curves(rows))
        name = wrapped(scene_name(scene), 16)
        panel(axes, letter, f"{name}\n(saturated)" if saturated(measured) else name)
        axes.set(xlim=(0.2, 0.95), xticks=[0.25, 0.5, 0.75])
        axes.set_xlabel("quantile of the threshold", fontsize=6)
    panels[0].set_ylabel("test accuracy (%)")
    handles, labels = panels[0].get_legend_handles_labels()
    where: Any = {"loc": "outside lower center", "ncols": len(handles)}
    figure.legend(handles, labels, title="frames per class", **where)


def _draw_curves(axes: Axes, every: pd.DataFrame) -> None:
    """A line for each number of frames per class; the stated quantile is a point of it."""
    for n, curve in every.groupby("n"):
        colour, marker = SIZES.get(int(n), ("black", "o"))
        by_quantile = curve[~curve.stated].groupby("at").accuracy
        found = [_spread(values) for _, values in by_quantile]
        value, spread = errors(found, 100)
        axes.errorbar(
            list(by_quantile.groups),
            value,
            yerr=spread,
            color=colour,
            marker=marker,
            ms=2.6,
            lw=0.9,
            elinewidth=0.5,
            label=str(n),
        )
