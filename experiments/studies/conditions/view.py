"""Conditions of Table I: which recipes give the published row of softmax regression, and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.plot import panel
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import number, percent

NAME = "table1_conditions"
SHARE = 0.8  # of the trials in which a condition must give the published accuracies
KEY = ["method", "pixels", "start", "sigma"]
PIXELS = {"unit": "0…1", "raw": "0…255", "standard_global": "standardised"}
METHODS = {"GD": "GD, all frames", "SGD": "SGD, batches of 20", "published": "published"}
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
COLUMNS = {
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
    "step_s": Column("Seconds a step"),
    "time_90_s": Column("Seconds to 90 %"),
    "time_over_hdc": Column("× HDC"),
}


# Tables -------------------------------------------------------------------------------------------


@STUDY.table(
    NAME,
    of=NAME,
    title="Softmax regression by gradient descent and SGD, over what the paper does not state",
    note="Trials: sensors times draws of the initial weights; accuracies are means over them, "
    "steps medians. As published: training and test accuracy lie within the published intervals at "
    "the step where training reaches the published maximum, and HDC has at least 99 % on the same "
    "frames. Start projected: without the part of the initial weights that is orthogonal to all "
    "training frames, which training never changes. A dash: not reached in most trials.",
    columns=COLUMNS,
)
def conditions(rows: pd.DataFrame, config: dict[str, Any]) -> pd.DataFrame:
    """One row a condition: optimiser, scale of the pixels and initial weights."""
    groups = rows.assign(inside=as_published(rows)).groupby(KEY, sort=False)
    names = ("test_90", "steps_end", "train_end", "test_end", "projected_end", "hdc", "inside")
    lines = groups.agg(
        trials=("draw", "size"),
        steps_90=("steps_90", median_of_most),
        **{name: (name, median_of_most if "steps" in name else mean_of_most) for name in names},
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


@STUDY.table(
    f"{NAME}_times",
    title="Time ratios of the conditions that give the published accuracies",
    note="Conditions with the published accuracies in at least 80 % of the trials. Seconds a step: "
    "of ordinary runs of softmax regression with this optimiser and batch on the machine of the "
    "HDC runs, frames in memory, without evaluation. × HDC: over the median training time of HDC "
    "there. A dash: there is no such run. The paper's machine is another.",
    columns=COLUMNS,
    commands=(
        f"{RUN}{NAME}",
        f"{RUN}table1_extended model=softmax_sgd,hdc",
        # Seconds a step of gradient descent.
        f"{RUN}table1_extended model=softmax_sgd model.batch_size=null model.max_epochs=20",
    ),
)
def times(results: Results) -> pd.DataFrame | None:
    """One row a condition: steps and seconds until training exceeds 90 %, over HDC's time."""
    measured = results.measured(NAME)
    hdc = [run.record for run in results.group("touch", "hdc").runs]
    if measured is None or not hdc:
        return None
    config = measured.record.config
    lines = conditions(measured.frame, config)
    lines = lines[lines["inside"] >= SHARE][["method", "pixels", "start", "steps_90"]]
    machine = hdc[0].environment.cpu, hdc[0].environment.threads
    step = {
        name: seconds_per_step(results, how["batch"], machine)
        for name, how in config["methods"].items()
    }
    lines["step_s"] = lines["method"].map(step).astype(float)
    lines["time_90_s"] = lines["steps_90"] * lines["step_s"]
    lines["time_over_hdc"] = lines["time_90_s"] / np.median([record.training_s for record in hdc])
    time, ratio = (
        published.value(f"table1/softmax_{x}") for x in ("training_time", "time_over_hdc")
    )
    paper = {"method": "published", "time_90_s": time, "time_over_hdc": ratio}
    return pd.concat([lines, pd.DataFrame([paper])])


def seconds_per_step(results: Results, batch: int | None, machine: tuple[str, int]) -> float:
    """Median over ordinary runs of softmax regression by SGD in such batches; NaN without any."""
    seconds = []
    for run in results.runs:
        record, model = run.record, run.record.config["model"]
        recipe = model.get("optimizer"), model.get("batch_size", 0), run.scene
        here = record.environment.cpu, record.environment.threads
        if recipe == ("SGD", batch, "touch") and here == machine and "filters" not in model:
            steps = run.curve[-1]["samples_seen"] / (batch or record.n_train)
            seconds.append(run.curve[-1]["training_s"] / steps)
    return float(np.median(seconds)) if seconds else np.nan


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


# Figure -------------------------------------------------------------------------------------------

# Okabe and Ito's colours; markers repeat the distinction.
_PIXELS = {"unit": ("#0072B2", "o"), "raw": ("#D55E00", "s"), "standard_global": ("#009E73", "D")}


@STUDY.figure(
    NAME,
    of=NAME,
    caption="Softmax regression by gradient descent and the scale σ of its initial weights: test "
    "accuracy where training reaches the published 99.2 % (grey: the published interval), and test "
    "error there against the noise that training never removes from a test logit. On pixels of "
    "0…255 a single step moves the logits by more.",
    size=(3.4, 4.8),
)
def figure(figure: Figure, rows: pd.DataFrame, config: dict[str, Any]) -> None:
    """Accuracy against σ, and its mechanism: σ times the part of a frame outside the span."""
    reached, mechanism = figure.subplots(2, 1)
    dots: dict[str, Any] = {"ls": "", "ms": 2.6, "mew": 0.6, "mfc": "none", "alpha": 0.75}
    for pixels, (colour, marker) in _PIXELS.items():
        part = rows[(rows["method"] == "GD") & (rows["pixels"] == pixels)]
        means = 100 * part.groupby("sigma")["test_end"].agg(mean_of_most)
        look = {"color": colour, "marker": marker, "label": f"pixels {PIXELS[pixels]}"}
        reached.plot(means, **look)
        noise = part["sigma"] * part["across"]
        mechanism.plot(noise, 100 * (1 - part["test_end"]), **look, **dots)
        if pixels == "unit":
            dark = {"color": "k", "marker": "v", "label": "pixels 0…1, start projected on the span"}
            mechanism.plot(noise, 100 * (1 - part["projected_end"]), **dark, **dots)
    known = published.numbers()
    test, train = (known[f"table1/softmax_{name}_accuracy"] for name in ("test", "training"))
    reached.axhspan(test.low, test.high, color="0.88", lw=0, zorder=0)
    reached.set(ylabel="test accuracy (%)", ylim=(50, 102))
    reached.set_xlabel("standard deviation of the initial weights, σ")
    panel(reached, "a", f"Test accuracy where training reaches {number(train.value)} %")
    mechanism.set(ylabel="test error (%)", ylim=(-2, 55))
    mechanism.set_xlabel("σ·|x⊥|: noise of a test logit that training never changes")
    panel(mechanism, "b", "Noise of the initial weights, and the test error")
    reached.set_xscale("symlog", linthresh=1e-3)
    reached.set_xlim(-2e-4, 0.13)
    mechanism.set_xscale("log")
    for axes in (reached, mechanism):
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    handles, labels = mechanism.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
