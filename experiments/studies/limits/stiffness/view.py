"""Stiffness of softmax regression: its stable learning rates."""

from __future__ import annotations

import math

import pandas as pd

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.study import TableOf
from experiments.reporting.text import number

SHARP = 1.2  # factor between the measured and the predicted limit, beyond which theory fails
GROUP = ["pixels", "method", "start"]
SCALINGS = {"raw": "0…255", "unit": "0…1", "standard": "standardised"}
COLUMNS = {
    "pixels": Column("Pixels", lambda name: SCALINGS[name]),
    "method": Column("Method"),
    "start": Column("Start"),
    "lambda_max": Column("λ_max"),
    "predicted": Column("Predicted limit"),
    "rises": Column("Loss rises above"),
    "exceeds": Column("Loss exceeds the start above"),
    "ends_above": Column("Loss ends above the start above"),
    "exceeds_over_predicted": Column("Exceeds / predicted"),
    "verdict": Column("Verdict"),
    "published_over_predicted": Column("Published rate / predicted"),
}


def limits(
    rows: pd.DataFrame,
) -> pd.DataFrame:
    """One row a sweep: the predicted largest stable rate and the measured ones."""
    lines = []
    rate = published.value("table1/learning_rate")
    for key, sweep in rows.groupby(GROUP, sort=False):
        predicted = sweep["predicted"].iloc[0]
        line = dict(zip(GROUP, key, strict=True))
        line["lambda_max"] = sweep["lambda_max"].iloc[0]
        line["predicted"] = predicted
        for name in ("rises", "exceeds", "ends_above"):
            line[name] = crossing(sweep, name)
        over = crossing(sweep.assign(rate=sweep["rate"] / predicted), "exceeds")
        line["exceeds_over_predicted"] = over
        line["verdict"] = verdict(line["start"], over)
        line["published_over_predicted"] = rate and rate / predicted
        lines.append(line)
    return pd.DataFrame(lines)


def verdict(start: str, over: float | str) -> str:
    """Whether the limit is where it was predicted: near the optimum, where the theory is local and
    sharp, within :data:`SHARP` of it; elsewhere the prediction is of the first steps alone, and the
    loss may fall again later, so that nothing is judged."""
    if start != "optimum":
        return "not judged"
    near = not isinstance(over, str) and 1 / SHARP <= over <= SHARP
    return "holds" if near else "fails"


def crossing(sweep: pd.DataFrame, name: str) -> float | str:
    """Rate above which something happens; ``> rate`` or ``< rate`` if it never or always does."""
    ordered = sweep.sort_values("rate")
    rates, happens = ordered["rate"].tolist(), ordered[name].tolist()
    if not any(happens):
        return f"> {number(rates[-1])}"
    at = happens.index(True)
    return math.sqrt(rates[at - 1] * rates[at]) if at else f"< {number(rates[0])}"


TABLES = [
    TableOf(
        "stiffness",
        limits,
        of="stiffness",
        title="Largest stable learning rates of softmax regression, {frames}",
        note="Predicted: 2/λ_max of the Hessian at the start, for SGD in batches of 20 of the "
        "mean over minibatches. Measured: geometric mean of the two swept rates between which it "
        "begins. Start “optimum”: of the penalised loss, slightly perturbed; there the limit "
        "holds if it is within a factor of 1.2 of the prediction. From zero weights the "
        "prediction is of the first steps; where the loss never exceeds its start, the last rate "
        "of the sweep is shown.",
        columns=COLUMNS,
    )
]
