"""Errors of predicted values, and whether sets, intervals and probabilities hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from experiments.records.results import by_scene
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.facets import facets
from experiments.reporting.plot import handle, legend_below, wrapped
from experiments.reporting.resamples import (
    models_of,
    over_units,
    seeds_are_units,
)
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import SIMULATED, kind_of, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

FEWEST = 20
"""Answers of a bin that the figure shows."""
SHOWN = ("hdc", "hdc_lda", "hdc_kernel")
"""Read-outs of the figure: published, and LDA and kernel of the same bits."""
ROWS = {
    "random": "frames like those\nin training",
    "counts": "another session,\ntime or position",
}
SESSIONS = {"random": "same", "counts": "next"}
SESSION = "Same session: a random split; next: split by session, time or position. "
OF_SESSION = Column("Session", lambda split: SESSIONS.get(split, split))


def errors(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, split and number of training frames; a column for each model. Means are
    over seeds, or over draws where there is one seed."""
    numbers = {"error": float, "inside": float}
    lines = []
    for scene, rows in by_scene(frame).items():
        first, several = rows.iloc[0], seeds_are_units(rows)
        of_unit = ["split", "n", "model", "seed" if several else "draw"]
        by_unit = rows.astype(numbers).groupby(of_unit, sort=False)
        means = by_unit[[*numbers]].mean().round(9)
        for (split, n), same in means.groupby(["split", "n"], sort=False):
            answer = f"{first.value}, {first.unit}"
            line = {"recording": scene, "answer": answer, "split": split, "n": n}
            for model, own in same.groupby("model"):
                line |= over_units(own.error.tolist(), several).columns(str(model))
            if inside := same.inside.dropna().tolist():  # intervals of the regressor
                line |= over_units(inside, several).within(0, 1).columns("inside")
            lines.append(line)
    return pd.DataFrame(lines)


def promises(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each read-out, n and split: means over scenes, and the least coverage."""
    by = ["model", "n", "split"]
    of_scenes = frame.groupby([*by, "scene"], sort=False)[["covered", "size"]].mean()
    return (
        of_scenes.round(9)
        .groupby(by, sort=False)
        .agg(
            covered=("covered", "mean"),
            least=("covered", "min"),
            size=("size", "mean"),
        )
        .reset_index()
    )


def reliability(frame: pd.DataFrame) -> pd.DataFrame:
    """At the most training frames, the mean ``probability`` and the share of ``right`` answers of
    each bin with enough answers, in percent: of :data:`SHOWN`, on frames that are not simulated."""
    most = frame[frame.n == frame.groupby("scene").n.transform("max")]
    most = most[most.model.isin(SHOWN) & (most.origin.map(kind_of) != SIMULATED)]
    by = ["scene", "split", "model", "place"]
    bins = (
        most.groupby(by, sort=False)[["answers", "right", "sure"]].sum().reset_index()
    )
    kept = bins[bins.answers >= FEWEST]
    shares = 100 * kept[["sure", "right"]].div(kept.answers, axis="index")
    return kept.assign(probability=shares.sure, right=shares.right)


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per session and scene, a line per model."""
    names = ("probability", "right", "model", "split", "scene")
    panels = facets(figure, data, *names, sharex=True, sharey=True)
    for (split, _), axes in panels.items():
        axes.plot([0, 100], [0, 100], color="0.6", lw=0.8)
        axes.set(xlim=(0, 103), ylim=(0, 103), xlabel="probability (%)")
        axes.set_ylabel(f"{ROWS.get(split, split)}\nright (%)")
        axes.label_outer()
    for scene, axes in zip(data.scene.unique(), figure.axes, strict=False):
        axes.set_title(wrapped(scene_name(scene), 20), fontsize=6.5, loc="left")
    legend_below(figure, map(handle, models_of(data)), 3)


TABLES = [
    Table(
        "promises",
        promises,
        of="coverage",
        title="How often the right label is in a set that is to hold it with 90 %",
        key=("model", "n", "split"),
        columns={
            "model": Column("Read-out", display_name),
            "n": Column("Frames of a class"),
            "split": OF_SESSION,
            "covered": Column("Covered, %", percent),
            "least": Column("lowest, %", percent),
            "size": Column("Labels of a set"),
        },
        note="HDCClassifier.predict_set with alpha = 0.1, means over data sets, and the one with "
        f"the lowest. {SESSION}The promise is for the same session alone. A class of one to three "
        "frames is in every set.",
    ),
    Table(
        "values",
        errors,
        of="values",
        title="Mean absolute error of predicted values",
        key=("recording", "answer", "split", "n"),
        columns={
            "recording": Column("Frames", scene_name),
            "answer": Column("Value"),
            "split": OF_SESSION,
            "n": Column("Training frames"),
            "mean": Column("Mean of the training frames"),
            "ridge_greys": Column("Ridge on grey values"),
            "regressor": Column("HDCRegressor"),
            "inside": Column("In its intervals, of 90 %", percent),
        },
        shown=(
            *("recording", "answer", "split", "n"),
            *("mean", "ridge_greys", "regressor", "inside"),
        ),
        note=f"{SESSION}HDCRegressor: ridge regression on bits; 1 − 2·alpha of its intervals is "
        "proven for the same session, about 1 − alpha is expected. Ridge: the penalty of the least "
        "leave-one-out error. Brackets: Student over sensors or input fields; of one camera, the "
        "central 95 % of draws, none of fewer than ten.",
    ),
]
FIGURES = [
    Figure(
        "calibration",
        Table("calibration", reliability, of="coverage"),
        draw,
        title="Share of right answers against their probability",
        details="Above: random split; below: split by session, time or position",
        caption="Share of right answers against their probability, at the most training frames; "
        "a column of panels per data set; above, test frames like those in training, below, of "
        "another session, time or position. On the grey diagonal probabilities are perfect; below "
        f"it they are too high. Points of fewer than {FEWEST} answers are left out.",
        size=(7.0, 4.4),
    )
]
