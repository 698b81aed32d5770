"""Where accuracy crosses 90 % in one experiment, and what theory expects (Fig. 5(b))."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.curves import line_plot
from experiments.reporting.estimates import Estimate
from experiments.reporting.plot import handle, panel, style_of
from experiments.reporting.study import Study

STUDY = Study(
    "crossing",
    "Few samples, in one experiment",
    "At which N does one experiment exceed 90 %, how sure is that number, and what does theory "
    "expect before a frame is classified?",
    2.5,
)
LEVEL = 0.9
# Columns of crossing_theory: name, line.
THEORY: dict[str, Any] = {
    "hdc": ("HDC by theory, skewed", "-"),
    "hdc_gaussian": ("HDC by theory, Gaussian", (0, (1, 1))),
    "mean_image": ("Image correlation by theory", (0, (4, 2))),
}
_LIMIT = published.numbers()["accuracy_vs_n/n_for_90_percent"].value
# How the paper's level and limit are drawn.
_MARK: Any = {"color": "0.5", "lw": 0.7, "ls": (0, (4, 3)), "zorder": 0}


def _whole(n: float) -> str:
    return "∞" if np.isinf(n) else f"{n:g}"


def tidy(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each n: ``seed``, ``draw``, ``model``, ``n``, ``accuracy``, and whether classes
    are ``equal``."""
    every = rows.explode(["n", "right"])
    every = every.astype({"n": int, "right": int})
    return every.assign(
        accuracy=every.right / every.n_test, equal=every.n % every.n_classes == 0
    ).reset_index(drop=True)


def first_crossings(rows: pd.DataFrame) -> pd.DataFrame:
    """First n of each experiment above 90 %, among those with as many samples of every class:
    ``model``, ``seed``, ``draw``, ``first`` (infinite where the last n is not enough)."""
    every = tidy(rows)
    every = every[every.equal]
    n = every.n.where(every.accuracy > LEVEL, np.inf)
    keys = ["model", "seed", "draw"]
    experiments = every.assign(first=n).groupby(keys, sort=False)
    return experiments["first"].min().reset_index()


@STUDY.table(
    "crossing",
    of="crossing",
    key=("model",),
    title=f"First N at which one experiment exceeds {LEVEL:.0%}, on {{frames}}",
    columns={"first": Column("First N, median [95 % of experiments]", _whole)},
    note=f"The paper: the accuracy exceeded {LEVEL:.0%} only when N > {_LIMIT:g}. Asked at "
    "multiples of the number of classes, as the paper's N_s = N/L; ∞: the last N was not enough. "
    "The N of one experiment are nested; whether the paper's were is not known. The simulated "
    "sensor was fitted to this number, so agreement is no evidence.",
)
def first(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """Distribution of the first crossing by model."""
    table = []
    for model, of_model in first_crossings(rows).groupby("model", sort=False):
        estimate = middle(of_model["first"])
        table.append({"model": model, **estimate.columns("first")})
    return pd.DataFrame(table)


def middle(first: pd.Series) -> Estimate:
    """Median and central 95 % of experiments; an infinity is no number to average."""
    levels = (0.025, 0.5, 0.975)
    low, median, high = np.quantile(first, levels, method="inverted_cdf")
    return Estimate(median, low, high)


@STUDY.figure(
    "crossing",
    of=("crossing", "crossing_theory"),
    size=(3.4, 4.9),
    caption="Test accuracy against N, with theory, and the share of experiments that have "
    "exceeded 90 % by then, on {frames} (Fig. 5(b)); bars: 95 % over sensors, each the mean of its "
    "experiments; theory is from correlations alone.",
)
def figure(
    figure: Figure,
    rows: pd.DataFrame,
    expected: pd.DataFrame,
    config: Mapping[str, Any],
) -> None:
    """(a) accuracy, with theory; (b) cumulative distribution of the first N."""
    every = tidy(rows).assign(percent=lambda frame: 100 * frame.accuracy)
    equal = every[every.equal]
    n = np.unique(equal.n)
    firsts = first_crossings(rows)
    shown = [name for name in THEORY if expected[name].notna().any()]
    accuracy, share = figure.subplots(2, 1, sharex=True)
    line_plot(accuracy, equal, "n", "percent", ms=2.2)
    _draw_theory(accuracy, expected[expected.n.isin(n)], shown)
    accuracy.set_ylabel("test accuracy (%)")
    _draw_shares(share, firsts, n)
    share.set_xlim(every.n.min() - 1, every.n.max() + 1)
    panel(accuracy, "a", "as many samples of every class")
    panel(share, "b", "first N above 90 %, as many samples of every class")
    for axes in (accuracy, share):
        axes.axvline(_LIMIT, **_MARK)
    lines = [
        Line2D([], [], color="black", ls=line, label=label)
        for label, line in (THEORY[name] for name in shown)
    ]
    handles = [*map(handle, firsts.model.unique()), *lines]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


def _draw_theory(axes: Axes, expected: pd.DataFrame, names: Sequence[str]) -> None:
    """Accuracies that theory expects, mean over seeds, and the paper's level."""
    for name in names:
        mean = 100 * expected.groupby("n")[name].mean()
        _, line = THEORY[name]
        axes.plot(mean.index, mean, color="black", ls=line, lw=0.9, zorder=4)
    axes.axhline(100 * LEVEL, **_MARK)


def _draw_shares(axes: Axes, firsts: pd.DataFrame, n: NDArray[Any]) -> None:
    """The share of experiments that have exceeded the level by each N, a line a model."""
    for model, of_model in firsts.groupby("model", sort=False):
        colour, marker, line = style_of(str(model))
        passed = [100 * (of_model["first"] <= k).mean() for k in n]
        axes.step(n, passed, where="post", color=colour, ls=line, lw=0.9)
        axes.plot(n, passed, color=colour, marker=marker, ms=2.2, ls="")
    axes.set_ylabel("experiments that have\nexceeded 90 % (%)")
    axes.set_xlabel("training samples of all classes, N")
    text = f"paper: > 90 % only for N > {_LIMIT:g}"
    axes.text(_LIMIT + 0.7, 3, text, fontsize=6, color="0.3")
