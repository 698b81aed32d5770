"""Stiffness of softmax regression: stable learning rates, and error against time of each method."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.plot import error_time_plot, panel, plain_decades
from experiments.reporting.study import Study
from experiments.reporting.text import number, percent

STUDY = Study(
    "stiffness",
    "Stiffness of training",
    "Which learning rates are stable, as gradient descent is the explicit Euler method? And how "
    "long do explicit, adaptive and second-order methods take to the same optimum?",
    11,
)
GAPS = (1e-1, 1e-3, 1e-5)  # of F − F*, to which the time is told
GROUP = ["pixels", "method", "start"]
# Okabe and Ito's colours; marker and line repeat the distinction.
SCALINGS = {
    "raw": ("0…255", "#0072B2", "o"),
    "unit": ("0…1", "#D55E00", "s"),
    "standard": ("standardised", "#009E73", "^"),
}
CURVES = {
    "GD, unit": ("gradient descent", "#D55E00", "s", "-"),
    "GD, unit_centred": ("gradient descent, centred", "#D55E00", "s", ":"),
    "GD dual, centred": ("gradient descent, dual", "#E69F00", "o", "--"),
    "Adam, 0.0001": ("Adam, 1e-4 (published)", "#0072B2", "^", "-"),
    "Adam, 0.0003": ("Adam, 3e-4", "#0072B2", "^", ":"),
    "L-BFGS, unit": ("L-BFGS", "#009E73", "v", "-"),
    "L-BFGS, unit_centred": ("L-BFGS, centred", "#009E73", "v", ":"),
    "Newton dual, centred": ("Newton, dual", "#000000", "D", "--"),
}
COLUMNS = {
    "pixels": Column("Pixels", lambda name: SCALINGS[name][0] if name in SCALINGS else name),
    "method": Column("Method"),
    "start": Column("Start"),
    "lambda_max": Column("λ_max"),
    "predicted": Column("Predicted limit"),
    "rises": Column("Loss rises above"),
    "exceeds": Column("Loss exceeds the start above"),
    "ends_above": Column("Loss ends above the start above"),
    "exceeds_over_predicted": Column("Exceeds / predicted"),
    "published_over_predicted": Column("Published rate / predicted"),
    "rate": Column("Rate"),
    **{f"seconds_to_{gap:g}": Column(f"s to F − F* ≤ {gap:g}") for gap in GAPS},
    "seconds": Column("s in all"),
    "loss_gap": Column("F − F* at the end"),
    "test_error": Column("Test error at the end, %", percent),
}


@STUDY.table(
    "stiffness",
    of="stiffness",
    title="Largest stable learning rates of softmax regression, {frames}",
    note="Predicted: 2/λ_max of the Hessian at the start, for SGD in batches of 20 of the mean "
    "over minibatches. Measured: geometric mean of the two swept rates between which it begins. "
    "Start “optimum”: of the penalised loss, slightly perturbed.",
    columns=COLUMNS,
)
def limits(rows: pd.DataFrame, config: dict[str, Any]) -> pd.DataFrame:
    """One row a sweep: the predicted largest stable rate and the measured ones."""
    lines = []
    for key, sweep in rows.groupby(GROUP, sort=False):
        first = sweep.iloc[0]
        line = dict(zip(GROUP, key, strict=True)) | first[["lambda_max", "predicted"]].to_dict()
        line |= {name: crossing(sweep, name) for name in ("rises", "exceeds", "ends_above")}
        if not isinstance(limit := line["exceeds"], str):
            line["exceeds_over_predicted"] = limit / first["predicted"]
        rate = published.value("table1/learning_rate")
        line["published_over_predicted"] = rate and rate / first["predicted"]
        lines.append(line)
    return pd.DataFrame(lines)


def crossing(sweep: pd.DataFrame, name: str) -> float | str:
    """Rate above which something happens; ``> rate`` or ``< rate`` if it never or always does."""
    ordered = sweep.sort_values("rate")
    rates, happens = ordered["rate"].tolist(), ordered[name].tolist()
    if not any(happens):
        return f"> {number(rates[-1])}"
    at = happens.index(True)
    return math.sqrt(rates[at - 1] * rates[at]) if at else f"< {number(rates[0])}"


@STUDY.figure(
    "stiffness_limit",
    of="stiffness",
    caption="Highest loss of softmax regression against the learning rate over the predicted "
    "limit, {frames}: from zero weights by gradient descent and SGD (open markers), and from near "
    "the optimum of the penalised loss. Losses beyond the axes are drawn at their edge.",
    size=(3.4, 4.4),
)
def stability_limit(figure: Figure, rows: pd.DataFrame, config: dict[str, Any]) -> None:
    """Loss over the first one, against the rate over the predicted limit."""
    first, second = figure.subplots(2, 1, sharex=True)
    curves(first, rows[rows["start"] == "zero"], "loss_max", 1e3)
    curves(second, rows[rows["start"] == "optimum"], "loss_end", 1e6)
    first.set_ylabel("highest / first loss")
    second.set(ylabel="last / first loss gap", xlabel="learning rate / predicted limit")
    panel(first, "a", "From zero weights")
    panel(second, "b", "From near the optimum, gradient descent")
    handles, labels = first.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)


def curves(axes: Axes, rows: pd.DataFrame, name: str, ceiling: float) -> None:
    """A curve a scaling and method; values above the ceiling, or NaN, are drawn there."""
    for (pixels, method), sweep in rows.groupby(["pixels", "method"], sort=False):
        label, colour, marker = SCALINGS[pixels]
        ratio = (sweep[name].astype(float) / sweep["loss_start"]).fillna(ceiling)
        line, fill = ("-", colour) if method == "GD" else (":", "white")
        look: dict[str, Any] = {"color": colour, "marker": marker, "ls": line, "mfc": fill}
        look["ms"] = 6 if pixels == "raw" else 3.5  # 0…1 gives the same ratios
        ratio = ratio.clip(1 / ceiling, ceiling)
        axes.loglog(sweep["rate"] / sweep["predicted"], ratio, label=f"{label}, {method}", **look)
    axes.axvline(1, color="0.5", lw=0.7, ls="--", zorder=0)
    axes.axhline(1, color="0.8", lw=0.7, zorder=0)
    axes.xaxis.set_minor_locator(NullLocator())
    plain_decades(axes)


def curve_of(rows: pd.DataFrame) -> pd.Series:
    """Name of the curve of each evaluation: the method, and its rate (Adam) or its pixels."""
    adam = rows["method"] == "Adam"
    return rows["method"] + ", " + rows["pixels"].where(~adam, rows["rate"].map("{:g}".format))


@STUDY.table(
    "softmax_methods",
    of="softmax_methods",
    title="Softmax regression by explicit, adaptive and second-order methods, {frames}, {machine}",
    note="F: mean cross-entropy + ‖W‖²/(2CN), pixels in 0…1; F*: the dual Newton method at its "
    "tightest. Gradient descent at 0.9 of its stability limit. A dash: not reached.",
    columns=COLUMNS,
)
def methods(rows: pd.DataFrame, config: dict[str, Any]) -> pd.DataFrame:
    """One row a method: the time to each gap, and where it ended."""
    lines = []
    for _, curve in rows.groupby(curve_of(rows), sort=False):
        # Each number of steps in sample space is a run of its own.
        curve = curve.sort_values(["steps", "seconds"])
        last = curve.iloc[-1]
        line = last[["method", "pixels", "rate"]].to_dict()
        for gap in GAPS:
            within = curve.loc[curve["loss_gap"] <= gap, "seconds"]
            line[f"seconds_to_{gap:g}"] = within.iloc[0] if len(within) else None
        lines.append(line | last[["seconds", "loss_gap", "test_error"]].to_dict())
    return pd.DataFrame(lines)


@STUDY.figure(
    "softmax_methods",
    of="softmax_methods",
    caption="Loss above the optimum of methods for softmax regression against training time, "
    "{frames}: the least until then.",
    size=(3.4, 3.6),
)
def error_against_time(figure: Figure, rows: pd.DataFrame, config: dict[str, Any]) -> None:
    """Loss gap against training time, a curve a method."""
    rows = rows.assign(curve=curve_of(rows)).sort_values("seconds")
    rows = rows[rows["curve"].isin(list(CURVES))]
    # Weights in float32 tell no gap below 1e-9.
    rows["loss_gap"] = rows.groupby("curve")["loss_gap"].cummin().clip(lower=1e-9)
    names = ("label", "color", "marker", "ls")
    looks = {name: dict(zip(names, look, strict=True)) for name, look in CURVES.items()}
    axes = figure.subplots()
    handles = error_time_plot(axes, rows, "seconds", "loss_gap", "curve", looks)
    axes.set(xlabel="training time (s)", ylabel="loss above the optimum, F − F*")
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
