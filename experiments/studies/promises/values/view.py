"""Errors of predicted values, and whether sets, intervals and probabilities hold."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.results import by_scene, once
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import (
    models_of,
    over_units,
    saturated,
    seeds_are_units,
)
from experiments.reporting.plot import LETTERS, literal, panel, style_of, wrapped
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import number, percent, points

FEWEST = 20
"""Answers of a bin that the figure shows."""
COUNTING = ("hdc", "hdc_integer")
"""Models whose promise is proven, and from how many frames of a class at 90 %."""
PROVEN_FROM = 9
OF_BINS = ["answers", "right", "sure", "spread"]
MEASURED = (
    *("covered", "size", "refused", "unknown_refused"),
    *("accuracy", "calibration", "perfect"),
)
SHARES = ("covered", "inside", "refused", "unknown_refused", "accuracy", "calibration")
# Okabe and Ito's: all models are HDC, and of one colour elsewhere.
COLOURS = (
    "#D55E00",
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#56B4E9",
    "#CC79A7",
    "black",
)
SESSIONS = {"random": "same", "counts": "next"}
COLUMNS = {
    "recording": Column("Frames", scene_name),
    "answer": Column("Value"),
    "split": Column("Session", lambda split: SESSIONS.get(split, split)),
    "model": Column("Read-out", display_name),
    "n": Column("Frames of a class"),
    "mean": Column("Mean guess", number),
    "ridge_greys": Column("Ridge on greys", number),
    "regressor": Column("HDCRegressor", number),
    "inside": Column("In its intervals, of 90 %", percent),
    "covered": Column("Covered, of 90 %", percent),
    "size": Column("Labels of a set", number),
    "calibration": Column("Calibration error, points", points),
    "perfect": Column("that of perfect probabilities, points", points),
    "promised": Column("Promised"),
    "same": Column("Covered, same session, %", percent),
    "same_least": Column("lowest, %", percent),
    "same_size": Column("Labels of a set", number),
    "next": Column("Covered, next session, %", percent),
    "next_least": Column("lowest, %", percent),
}
SESSION = "Same session: a random split; next: split by session, time or position. "
BRACKETS = (
    "Brackets: Student over sensors or input fields; of one camera, the central 95 % of draws, "
    "none of fewer than ten."
)


def estimated(
    rows: pd.DataFrame, by: list[str], columns: Sequence[str]
) -> dict[Any, dict[str, Estimate]]:
    """Of groups of the rows of one scene, in their order, means of those columns that no row of a
    group lacks: over seeds where there are several, else over draws."""
    several = seeds_are_units(rows)
    names = [name for name in columns if name in rows]
    units = rows[[*by, "seed", "draw"]].join(rows[names].astype(float))
    means = units.groupby([*by, "seed" if several else "draw"])[names].mean().round(9)
    complete = units[names].notna().groupby([rows[name] for name in by]).all()
    by_group = {key: of.to_numpy().T for key, of in means.groupby(level=by)}
    found: dict[Any, dict[str, Estimate]] = {}
    for key in dict.fromkeys(zip(*(rows[name] for name in by), strict=True)):
        found[key] = {}
        known = complete.loc[key]
        for name, values in zip(names, by_group[key], strict=True):
            if known[name]:
                value = over_units(values.tolist(), several)
                found[key][name] = value.within(0, 1) if name in SHARES else value
    return found


def errors(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, split and number of training frames."""
    lines = []
    for scene, rows in by_scene(frame).items():
        by_model = estimated(
            rows, ["split", "n", "model"], ("error", "inside", "width")
        )
        for (split, n), own in rows.groupby(["split", "n"], sort=False):
            first = own.iloc[0]
            note = ", saturated" if saturated(own) else ""
            line: dict[str, Any] = {"recording": f"{scene}{note}"}
            line |= {"answer": f"{first.value}, {first.unit}", "split": split, "n": n}
            for model in sorted(own.model.unique()):
                line |= by_model[split, n, model]["error"].columns(str(model))
            of_own = by_model.get((split, n, "regressor"), {})
            for name in ("inside", "width"):
                if name in of_own:
                    line |= of_own[name].columns(name)
            lines.append(line)
    return pd.DataFrame(lines)


def shown(data: pd.DataFrame) -> list[str]:
    """The columns of values that a table shows: with intervals where they were measured."""
    names = ("recording", "answer", "split", "n", "mean", "ridge_greys")
    return [name for name in (*names, "regressor", "inside") if name in data]


@once
def coverage(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each scene, split, model and n; None of records without models."""
    if "model" not in frame:
        return None
    every = frame.join(_calibration(frame[frame.answers.notna()]))
    lines = []
    for scene, rows in by_scene(every).items():
        found = estimated(rows, ["model", "n", "split"], MEASURED)
        places = models_of(rows)
        for model, n, split in sorted(found, key=lambda key: places.index(key[0])):
            line = {"recording": scene, "model": model, "n": n, "split": split}
            for name, value in found[model, n, split].items():
                line |= value.columns(name)
            lines.append(line)
    return pd.DataFrame(lines)


def _calibration(rows: pd.DataFrame) -> pd.DataFrame:
    """Of each row the share of right answers, the expected calibration error
    Σ_b |right answers − probabilities| / n of bins b (Guo et al., ICML 2017), and what perfect
    probabilities have on average: Σ_b √(2/π · Σ p(1 − p)) / n, for sums that are nearly normal."""
    n, right, sure, spread = (np.stack([*rows[name]]) for name in OF_BINS)
    of = n.sum(1)
    found = {
        "accuracy": right.sum(1) / of,
        "calibration": np.abs(right - sure).sum(1) / of,
        "perfect": np.sqrt(2 / np.pi * spread).sum(1) / of,
    }
    return pd.DataFrame(found, rows.index)


def promises(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each read-out and n: means over scenes, and the scene with the least coverage."""
    every = coverage(frame)
    if every is None:
        return None
    every = every.assign(place=pd.factorize(every.model)[0])
    lines = []
    for (_, n), rows in every.groupby(["place", "n"]):
        model = rows.model.iloc[0]
        line: dict[str, Any] = {"model": model, "n": n}
        line["promised"] = promise(str(model), n)
        for split, session in SESSIONS.items():
            own = rows[rows.split == split]
            line |= {session: own.covered.mean(), f"{session}_least": own.covered.min()}
            line[f"{session}_size"] = own["size"].mean()
        lines.append(line)
    return pd.DataFrame(lines)


def promise(model: str, n: int) -> str:
    """Promise of :mod:`hdc.conformal` for the same session at alpha 0.1."""
    if n < 4:
        return "all labels"
    return "at least 90 %" if model in COUNTING and n >= PROVEN_FROM else "about 90 %"


def draw(figure: Figure, frame: pd.DataFrame) -> None:
    """A panel per session and scene, a line per model."""
    scenes = by_scene(frame)
    sessions = list(frame.split.unique())
    looks = dict(zip(models_of(frame), itertools.cycle(COLOURS)))
    panels = figure.subplots(
        len(sessions), len(scenes), sharex=True, sharey=True, squeeze=False
    )
    for axes, letter, scene in zip(panels[0], LETTERS, scenes, strict=False):
        panel(axes, letter, wrapped(scene_name(str(scene)), 20))
    for line, session in zip(panels, sessions, strict=True):
        line[0].set_ylabel(f"{SESSIONS.get(session, session)} session\nright (%)")
        for axes, rows in zip(line, scenes.values(), strict=True):
            most = rows[(rows.n == rows.n.max()) & (rows.split == session)]
            axes.plot([0, 100], [0, 100], color="0.6", lw=0.8)
            for model, own in most.groupby("model", sort=False):
                look = {"color": looks[str(model)], "marker": style_of(str(model))[1]}
                axes.plot(*reliability(own), **look, ms=3, lw=0.8)
            axes.set(xlim=(0, 103), ylim=(0, 103))
    for axes in panels[-1]:
        axes.set_xlabel("probability (%)")
    handles = [
        Line2D([], [], color=colour, label=literal(display_name(model)))
        for model, colour in looks.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)


def reliability(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Mean probability and share of right answers, in %, of each bin with enough answers."""
    n, right, sure, _ = (np.sum(rows[name].tolist(), axis=0) for name in OF_BINS)
    kept = n >= FEWEST
    return 100 * sure[kept] / n[kept], 100 * right[kept] / n[kept]


TABLES = [
    Table(
        "promises",
        promises,
        of="coverage",
        title="How often the right label is in a set that is to hold it with 90 %",
        key=("model", "n"),
        columns=COLUMNS,
        shown=(
            "model",
            "n",
            "promised",
            "same",
            "same_least",
            "same_size",
            "next",
            "next_least",
        ),
        note="HDCClassifier.predict_set with alpha = 0.1, means over recordings, and the one with "
        f"the lowest. {SESSION}The promise is for the same session alone. At least: proven for "
        "every distribution of frames; about: by leave-one-out scores, or of classes with fewer "
        "than nine frames compared together. A class of one to three frames is in every set.",
    ),
    Table(
        "coverage",
        coverage,
        of="coverage",
        title="Label sets and probabilities of each recording and read-out",
        key=("recording", "model", "n", "split"),
        columns=COLUMNS,
        shown=(
            "recording",
            "model",
            "n",
            "split",
            "covered",
            "size",
            "calibration",
            "perfect",
        ),
        note=f"{SESSION}Calibration error: the expected one, over ten bins of equal width (Guo et "
        "al., ICML 2017); by chance alone it is above zero, as the last column has it. The CSV has "
        f"the shares of frames that are refused as unknown, too. {BRACKETS}",
    ),
    Table(
        "values",
        errors,
        of="values",
        title="Mean absolute error of predicted values",
        key=("recording", "answer", "split", "n"),
        columns=COLUMNS | {"n": Column("Training frames")},
        shown=shown,
        note=f"{SESSION}HDCRegressor: ridge regression on bits; 1 − 2·alpha of its intervals is "
        "proven for the same session, about 1 − alpha is expected. The CSV has its nearest frame, "
        "and prototypes of ten bins of the value that stand for the mean of the bin's training "
        f"frames. Ridge: the penalty of the least leave-one-out error. {BRACKETS} A saturated "
        "recording ranks nothing.",
    ),
]
FIGURES = [
    Plot(
        "calibration",
        draw,
        of="coverage",
        caption="Share of right answers against their probability, after most training frames; "
        "a row of panels per session, a column per recording. On the grey diagonal probabilities "
        f"are perfect; below it they promise too much. Points of fewer than {FEWEST} answers are "
        "left out.",
        size=(7.0, 4.2),
        needs=lambda frame: "answers" in frame,
    )
]
