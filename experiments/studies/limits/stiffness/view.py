"""Softmax regression as a stiff problem: error against run time, steps against κ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.reporting.columns import Column
from experiments.reporting.plot import (
    DASHED,
    LETTERS,
    entry,
    legend_below,
    panel,
)
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import number
from experiments.reporting.trained import split_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

# Okabe and Ito's; dashed: solvers of this project.
COLOURS = {
    "gradient descent": "#56B4E9",
    "momentum": "#0072B2",
    "Adam": "#E69F00",
    "L-BFGS": "#009E73",
    "Newton": "#D55E00",
    "SoftmaxRegression": "#CC79A7",
    "DualSoftmaxRegression": "black",
}
MARKS = {"arrived": "o", "out of time": ">"}  # others: a cross
# Evaluations of the gradient as a power of κ.
LAWS = {"gradient descent": 1.0, "momentum": 0.5}
FLOOR = 1e-16  # smaller errors are drawn there


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power(value: float) -> str:
    """Two digits and a power of ten: 19, 1.7 × 10⁻¹⁵."""
    if 1 <= value < 1e4:
        return f"{value:.0f}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits} × 10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


COLUMNS = {
    "kappa": Column("Condition number", power),
    "method": Column("Method"),
    "ended": Column("Ended"),
    "fit_s": Column("Run time, s", of_machine=True),
    "evaluations": Column("Losses computed", of_machine=True),
    "error": Column("Loss minus optimum", lambda value: number(value, 2)),
}


def ends(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per problem and method: where it ended."""
    return frame[frame.ended.fillna("") != ""][["apart", "strength", *COLUMNS]]


def curves(frame: pd.DataFrame) -> pd.DataFrame:
    """The points of each method on its way, and the condition numbers of ``real`` problems."""
    names = ["scene", "origin", *COLUMNS, "real"]
    return frame[names].assign(split=split_of(frame))


def look_of(method: str) -> dict[str, Any]:
    """Colour and line of a method, the same for all rates."""
    family, _, _ = method.partition(",")
    line = "--" if family.endswith("Regression") else "-"
    return {"color": COLOURS[family], "ls": line, "lw": 1}


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per problem, a line per method, a mark where it ended; and one of all problems."""
    problems = data[data.real.isna()].groupby("kappa")
    panels = figure.subplots(-(-(len(problems) + 1) // 3), 3).flat
    for axes, letter, (kappa, of_problem) in zip(
        panels, LETTERS, problems, strict=False
    ):
        for method, curve in of_problem.groupby("method", sort=False):
            look = look_of(str(method))
            times, errors = 1e3 * curve.fit_s, curve.error.clip(lower=FLOOR)
            axes.loglog(times, errors, **look)
            mark = MARKS.get(curve.ended.iloc[-1], "x")
            axes.plot(times.iloc[-1], errors.iloc[-1], marker=mark, ms=4, **look)
        axes.set(xlabel="run time (ms)", ylabel="loss minus optimum")
        panel(axes, letter, f"condition number {power(kappa)}")
    _draw_steps(panels[len(problems)], data)
    panel(panels[len(problems)], LETTERS[len(problems)], "until it arrives")
    legend_below(figure, [entry(name, **look_of(name)) for name in COLOURS], 4)


def _draw_steps(axes: Axes, data: pd.DataFrame) -> None:
    """Evaluations over κ of those that arrived, the laws through the first, and real problems."""
    arrived = data[data.ended == "arrived"]
    kappas = np.array([data.kappa.min(), data.kappa.max()])
    for method, ends in arrived.groupby("method", sort=False):
        look = look_of(str(method)) | {"ls": "-", "marker": "o", "ms": 3}
        axes.loglog(ends.kappa, ends.evaluations, **look)
        if method in LAWS:
            first = ends.iloc[0]
            law = (kappas / first.kappa) ** LAWS[str(method)]
            axes.plot(kappas, first.evaluations * law, **DASHED)
    axes.set(xlabel="condition number", ylabel="losses computed", ylim=(1, 1e5))
    real = data[data.real.notna()].kappa
    for kappa in real:
        axes.axvline(kappa, 0, 0.06, color="black", lw=0.8)
    if len(real):
        axes.text(real.max(), 2.0, f" {len(real)} data sets", fontsize=6, va="center")


TABLE = Table(
    "stiffness",
    ends,
    of="stiffness",
    title="Softmax regression as a stiff problem, {frames}. {machine}",
    shown=tuple(COLUMNS),
    columns=COLUMNS,
    note="Frames are centred. The condition number rises as frames repeat each other more nearly "
    "and the penalty becomes weaker. Each method starts at zero weights and ends when its error is "
    "a millionth of the first (arrived), when its time is over, or when it goes no further. Adam's "
    "rate falls to zero along a cosine. "
    "SoftmaxRegression and DualSoftmaxRegression are solvers of this project. The optimum is found "
    "by Newton's method in extended precision.",
)
FIGURE = Figure(
    "stiffness",
    Table("stiffness_curves", curves, of="stiffness"),
    draw,
    title="Penalised softmax regression as a stiff problem",
    caption="Penalised softmax regression on centred training frames that nearly repeat each "
    "other: loss minus the loss of the optimum, in units of the first, against run time, a panel "
    "per condition number κ. A dot ends a line at a millionth, a triangle when the time is over, a "
    "cross when the method goes no further. Dashed lines: solvers of this project. Last panel: how "
    "often a method that arrives computes the loss; dashed: proportional to κ and to √κ, through "
    "the first point; ticks: κ of converged softmax on Table I's frames and on each data set whose "
    "files were there.",
    size=(7, 4.4),
)
