"""Softmax regression as a stiff problem: error against run time of five methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.reporting.columns import Column
from experiments.reporting.plot import LETTERS, entry, legend_below, panel
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import number
from experiments.reporting.trained import split_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

# Okabe and Ito's.
COLOURS = {
    "gradient descent": "#56B4E9",
    "momentum": "#0072B2",
    "Adam": "#E69F00",
    "L-BFGS": "#009E73",
    "Newton": "#D55E00",
}
FLOOR = 1e-16  # smaller errors are drawn there


def small(value: float) -> str:
    """A number of one digit and its power of ten."""
    return f"{value:.0e}"


COLUMNS = {
    "kappa": Column("Condition number", small),
    "method": Column("Method"),
    "ended": Column("Ended"),
    "fit_s": Column("Run time, s", of_machine=True),
    "evaluations": Column("Gradients"),
    "gradient": Column("Gradient, relative to the first", small),
    "error": Column("Loss minus optimum", lambda value: number(value, 2)),
}


def _best(frame: pd.DataFrame) -> pd.DataFrame:
    """The last line of each problem and method; of Adam that of the rate that ended best."""
    last = frame[frame.ended != ""]
    late = last.ended != "arrived"
    family = last.method.str.partition(",")[0]
    ordered = last.assign(late=late, family=family).sort_values(
        ["late", "error"], kind="stable"
    )
    return ordered.drop_duplicates(["problem", "family"]).sort_index()


def ends(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per problem and method: where it ended."""
    return _best(frame)[["contrast", "strength", *COLUMNS]]


def curves(frame: pd.DataFrame) -> pd.DataFrame:
    """The points of the methods of :func:`ends`, on their way; ``family``: without the rate."""
    chosen = _best(frame)[["problem", "method", "family"]]
    names = ["scene", "origin", *COLUMNS, "family"]
    every = frame.merge(chosen, on=["problem", "method"])[names]
    return every.assign(split=split_of(frame))


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per problem, a line per method, a mark where it ended."""
    problems = data.groupby("kappa", sort=False)
    for k, (letter, (kappa, of_problem)) in enumerate(
        zip(LETTERS, problems, strict=False)
    ):
        axes = figure.add_subplot(-(-len(problems) // 3), 3, k + 1)
        for family, curve in of_problem.groupby("family", sort=False):
            times, errors = 1e3 * curve.fit_s, curve.error.clip(lower=FLOOR)
            look: Any = {"color": COLOURS[str(family)]}
            axes.loglog(times, errors, lw=1, **look)
            marker = {"arrived": "o", "out of time": ">"}.get(curve.ended.iloc[-1], "x")
            axes.plot(
                times.iloc[-1], errors.iloc[-1], marker, ms=4, clip_on=False, **look
            )
        axes.set(xlabel="run time (ms)", ylabel="loss minus optimum")
        panel(axes, letter, f"condition number {small(kappa)}")
    lines = [entry(name, color=c) for name, c in COLOURS.items()]
    legend_below(figure, lines, len(lines))


TABLE = Table(
    "stiffness",
    ends,
    of="stiffness",
    title="Softmax regression as a stiff problem, {frames}. {machine}",
    shown=tuple(COLUMNS),
    columns=COLUMNS,
    note="A weaker penalty and less contrast of the frames raise the condition number. Each "
    "method starts at zero weights and ends at a gradient of 10⁻⁶ of the first (arrived), with "
    "its time, or where it fails. Adam: the rate that ended best. Newton's method in extended "
    "precision finds the optimum. At the highest condition numbers nearly the whole first "
    "gradient lies in one direction, so that a small gradient leaves a large error.",
)
FIGURE = Figure(
    "stiffness",
    Table("stiffness_curves", curves, of="stiffness"),
    draw,
    title="Penalised softmax regression as a stiff problem",
    caption="Penalised softmax regression on training frames: loss minus that of the optimum "
    "against run time, a panel per condition number. Dot: the gradient fell to 10⁻⁶ of the first; "
    "triangle: the time ended; cross: the method failed. Errors below 10⁻¹⁶ are drawn there.",
    size=(7, 4.2),
)
