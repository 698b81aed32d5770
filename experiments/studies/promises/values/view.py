"""Errors of predicted values, and whether sets, intervals and probabilities hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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
COUNTING = ("hdc", "hdc_integer")
"""Models whose promise is proven, and from how many frames of a class at 90 %."""
PROVEN_FROM = 9
SHOWN = ("hdc", "hdc_lda", "hdc_kernel")
"""Read-outs of the figure: published, and LDA and kernel of the same bits."""
SESSIONS = {"random": "same", "counts": "next"}
ROWS = {
    "random": "frames like those\nin training",
    "counts": "another session,\ntime or position",
}
COLUMNS = {
    "recording": Column("Frames", scene_name),
    "answer": Column("Value"),
    "split": Column("Session", lambda split: SESSIONS.get(split, split)),
    "model": Column("Read-out", display_name),
    "n": Column("Frames of a class"),
    "mean": Column("Mean guess"),
    "ridge_greys": Column("Ridge on grey values"),
    "regressor": Column("HDCRegressor"),
    "inside": Column("In its intervals, of 90 %", percent),
    "same": Column("Covered, same session, %", percent),
    "same_least": Column("lowest, %", percent),
    "same_size": Column("Labels of a set"),
    "next": Column("Covered, next session, %", percent),
    "next_least": Column("lowest, %", percent),
}
SESSION = "Same session: a random split; next: split by session, time or position. "


def errors(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, split and number of training frames; a column for each model. Means are
    over seeds, or over draws where there is one seed."""
    numbers = dict.fromkeys(("error", "inside", "width"), float)
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
            own = same.xs("regressor", level="model")
            inside = over_units(own.inside.tolist(), several).within(0, 1)
            line |= inside.columns("inside")
            line |= over_units(own.width.tolist(), several).columns("width")
            lines.append(line)
    return pd.DataFrame(lines)


def promises(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each read-out and n: means over scenes, and the scene with the least coverage."""
    by_scene = frame.groupby(["model", "n", "split", "scene"], sort=False)
    every = by_scene[["covered", "size"]].mean().round(9).reset_index()
    lines = []
    for (_, n), rows in every.groupby([pd.factorize(every.model)[0], "n"]):
        model = rows.model.iloc[0]
        line: dict[str, Any] = {"model": model, "n": n, "promised": promise(model, n)}
        for split, session in SESSIONS.items():
            own = rows[rows.split == split]
            line |= {
                session: own.covered.mean(),
                f"{session}_least": own.covered.min(),
                f"{session}_size": own["size"].mean(),
            }
        lines.append(line)
    return pd.DataFrame(lines)


def promise(model: str, n: int) -> str:
    """Promise of :mod:`hdc.conformal` for the same session at alpha 0.1."""
    if n < 4:
        return "all labels"
    return "at least 90 %" if model in COUNTING and n >= PROVEN_FROM else "about 90 %"


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
        key=("model", "n"),
        columns=COLUMNS,
        shown=(
            *("model", "n", "promised"),
            *("same", "same_least", "same_size", "next", "next_least"),
        ),
        note="HDCClassifier.predict_set with alpha = 0.1, means over data sets, and the one with "
        f"the lowest. {SESSION}The promise is for the same session alone. At least: proven for "
        "every distribution of frames; about: by leave-one-out scores, or of classes with fewer "
        "than nine frames compared together. A class of one to three frames is in every set.",
    ),
    Table(
        "values",
        errors,
        of="values",
        title="Mean absolute error of predicted values",
        key=("recording", "answer", "split", "n"),
        columns=COLUMNS | {"n": Column("Training frames")},
        shown=(
            "recording",
            "answer",
            "split",
            "n",
            "mean",
            "ridge_greys",
            "regressor",
            "inside",
        ),
        note=f"{SESSION}HDCRegressor: ridge regression on bits; 1 − 2·alpha of its intervals is "
        "proven for the same session, about 1 − alpha is expected. The CSV has its nearest frame, "
        "and prototypes of ten bins of the value that stand for the mean of the bin's training "
        f"frames. Ridge: the penalty of the least leave-one-out error. Brackets: Student over "
        "sensors or input fields; of one camera, the central 95 % of draws, none of fewer than "
        "ten.",
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
