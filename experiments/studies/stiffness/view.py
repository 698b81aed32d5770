"""Stiffness of softmax regression: its stable learning rates."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.plot import panel, plain_decades
from experiments.reporting.study import Study
from experiments.reporting.text import number

STUDY = Study(
    "stiffness",
    "Stiffness of training",
    "Which learning rates are stable, as gradient descent is the explicit Euler method?",
    11,
)
GROUP = ["pixels", "method", "start"]
# Okabe and Ito's colours; marker and line repeat the distinction.
SCALINGS = {
    "raw": ("0…255", "#0072B2", "o"),
    "unit": ("0…1", "#D55E00", "s"),
    "standard": ("standardised", "#009E73", "^"),
}
COLUMNS = {
    "pixels": Column("Pixels", lambda name: SCALINGS[name][0]),
    "method": Column("Method"),
    "start": Column("Start"),
    "lambda_max": Column("λ_max"),
    "predicted": Column("Predicted limit"),
    "rises": Column("Loss rises above"),
    "exceeds": Column("Loss exceeds the start above"),
    "ends_above": Column("Loss ends above the start above"),
    "exceeds_over_predicted": Column("Exceeds / predicted"),
    "published_over_predicted": Column("Published rate / predicted"),
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
