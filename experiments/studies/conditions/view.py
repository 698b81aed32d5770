"""Conditions of Table I: which recipes give the published row of softmax regression, and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.study import Study
from experiments.reporting.text import percent

KEY = ["method", "pixels", "start", "sigma"]
PIXELS = {"unit": "0…1", "raw": "0…255", "standard_global": "standardised"}
METHODS = {"GD": "GD, all frames", "SGD": "SGD, batches of 20"}
# Who uses these initial weights by default.
USED_BY = {
    "zeros": "scikit-learn", "linear": "PyTorch nn.Linear", "glorot": "Keras Dense",
    "normal 0.01": "AlexNet", "normal 0.02": "BERT, GPT-2", "normal 0.05": "Keras RandomNormal",
}  # fmt: skip
STUDY = Study(
    "conditions",
    "What would have to be true for Table I",
    "The paper gives the learning rate, but not the optimiser, the initial weights, the scale of "
    "the pixels or when training was stopped. Which of them give the published row, and does the "
    "effect disappear when its cause is removed?",
    order=1.5,
    front=True,
)


@STUDY.table(
    "table1_conditions",
    of="table1_conditions",
    title="Softmax regression by gradient descent and SGD, over what the paper does not state",
    note="Trials: sensors times draws of the initial weights; accuracies are means over them, "
    "steps medians. As published: training and test accuracy lie within the published intervals at "
    "the step where training reaches the published maximum, and the accuracy of HDC on the same "
    "frames within its own; intervals are Wilson's, of as many samples as the paper has. Start "
    "projected: without the part of the initial weights that is orthogonal to all training frames, "
    "which training never changes. A dash: not reached in most trials.",
    columns={
        "method": Column("Optimiser, batch", lambda name: METHODS[name]),
        "pixels": Column("Pixels", lambda name: PIXELS[name]),
        "start": Column("Initial weights"),
        "sigma": Column("σ"),
        "trials": Column("Trials"),
        "steps_90": Column("Steps to 90 % in training"),
        "test_90": Column("Test accuracy at 90 %, %", percent),
        "steps_end": Column("Steps to 99.2 %"),
        "train_end": Column("Training accuracy at 99.2 %, %", percent),
        "test_end": Column("Test accuracy at 99.2 %, %", percent),
        "projected_end": Column("Test accuracy at 99.2 %, start projected, %", percent),
        "hdc": Column("HDC, %", percent),
        "inside": Column("Trials as published, %", percent),
    },
)
def conditions(
    rows: pd.DataFrame,
    config: dict[str, Any],
) -> pd.DataFrame:
    """One row a condition: optimiser, scale of the pixels and initial weights."""
    groups = rows.assign(inside=as_published(rows)).groupby(KEY, sort=False)
    names = (
        "test_90",
        "steps_end",
        "train_end",
        "test_end",
        "projected_end",
        "hdc",
        "inside",
    )
    lines = groups.agg(
        trials=("draw", "size"),
        steps_90=("steps_90", median_of_most),
        **{
            name: (name, median_of_most if "steps" in name else mean_of_most)
            for name in names
        },
    )
    return named(lines.reset_index())


def as_published(trials: pd.DataFrame) -> pd.Series:
    """Whether a trial ends within the published intervals, and HDC as well as published."""
    known = published.numbers()
    inside = 100 * trials["hdc"] >= (known["table1/hdc_test_accuracy"].low or 0) - 1e-7
    for column, name in (("train_end", "training"), ("test_end", "test")):
        value = known[f"table1/softmax_{name}_accuracy"]
        inside &= (100 * trials[column]).between(value.low, value.high)
    return inside


def named(lines: pd.DataFrame) -> pd.DataFrame:
    """The same with a start called by its deviation and by who uses it."""
    normal = "normal " + lines["sigma"].map("{:g}".format)
    start = lines["start"].where(lines["start"] != "normal", normal)
    used = start.map(USED_BY)
    return lines.assign(start=start.where(used.isna(), start + " (" + used + ")"))


def mean_of_most(values: pd.Series) -> float:
    """Mean; NaN unless most have a value."""
    return float(values.mean()) if 2 * values.count() > len(values) else np.nan


def median_of_most(values: pd.Series) -> float:
    """Median, a step that is not reached being later than any; NaN where the median is such."""
    middle = float(values.astype(float).fillna(np.inf).median())
    return middle if np.isfinite(middle) else np.nan
