"""Softmax regression as a stiff problem: error against run time of five methods."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.plot import LETTERS, head, literal, panel
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import frames_of, number

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


def ends(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """One row per problem and method: where it ended; of Adam the rate that ended best."""
    last = rows[rows.ended != ""]
    late = last.assign(late=last.ended != "arrived", family=family(last))
    ordered = late.sort_values(["late", "error"], kind="stable")
    best = ordered.drop_duplicates(["problem", "family"]).sort_index()
    return best[["contrast", "strength", *COLUMNS]].reset_index(drop=True)


def family(rows: pd.DataFrame) -> pd.Series:
    """The methods without their rates."""
    return rows.method.str.partition(",")[0]


def error_against_time(
    figure: Figure,
    rows: pd.DataFrame,
) -> None:
    """A panel per problem, a line per method, a mark where it ended."""
    chosen = ends(rows)
    kappas = chosen.kappa.unique()
    panels = figure.subplots(-(-len(kappas) // 3), 3, squeeze=False).ravel()
    for axes in panels[len(kappas) :]:
        axes.remove()
    for axes, letter, kappa in zip(panels, LETTERS, kappas, strict=False):
        for end in chosen[chosen.kappa == kappa].to_dict("records"):
            same = (rows.kappa == kappa) & (rows.method == end["method"])
            curve = rows[same]
            colour = COLOURS[end["method"].partition(",")[0]]
            error = curve.error.clip(lower=FLOOR)
            axes.loglog(1e3 * curve.fit_s, error, color=colour, lw=1)
            marker = {"arrived": "o", "out of time": ">"}.get(end["ended"], "x")
            at = 1e3 * curve.fit_s.iloc[-1], error.iloc[-1]
            axes.plot(*at, marker, color=colour, ms=4, clip_on=False)
        axes.set(xlabel="run time (ms)", ylabel="loss minus optimum")
        panel(axes, letter, f"condition number {small(kappa)}")
    lines = [Line2D([], [], color=c, label=name) for name, c in COLOURS.items()]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines))
    scene = literal(scene_name(rows.scene.iloc[0]))
    frames = frames_of(rows[:1].to_dict("records"))
    details = [", ".join(filter(None, [scene, frames, "training frames"]))]
    head(figure, "Penalised softmax regression as a stiff problem", details)


COLUMNS = {
    "kappa": Column("Condition number", small),
    "method": Column("Method"),
    "ended": Column("Ended"),
    "fit_s": Column("Run time, s"),
    "evaluations": Column("Gradients"),
    "gradient": Column("Gradient, relative to the first", small),
    "error": Column("Loss minus optimum", lambda value: number(value, 2)),
}
TABLES = [
    Table(
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
]
FIGURES = [
    Plot(
        "stiffness",
        error_against_time,
        of="stiffness",
        size=(7, 4.2),
        caption="Penalised softmax regression on {frames}: loss minus that of the optimum against "
        "run time, a panel per condition number. Dot: the gradient fell to 10⁻⁶ of the first; "
        "triangle: the time ended; cross: the method failed. Errors below 10⁻¹⁶ are drawn there.",
    )
]
