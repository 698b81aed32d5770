"""Values with their intervals over an axis: accuracies and errors of models.

An accuracy on n test samples cannot tell an error below 1/n from none: errors of zero are drawn in
a grey strip of their own below 1/n, labelled 0. Intervals are those of the tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from experiments.records.rows import Row
from experiments.reporting.estimates import Estimate
from experiments.reporting.plot import look_of, style_of


def errors(
    found: Sequence[Estimate],
    scale: float = 1.0,
) -> tuple[NDArray, NDArray]:
    """Values, and distances of the bounds from them [2, n] for ``errorbar``; zero if unknown."""
    estimates = np.array(found, float).reshape(-1, 3)
    value, low, high = scale * estimates.T
    distances = np.array([value - low, high - value])
    return value, np.nan_to_num(distances)


def bars(
    axes: Axes,
    model: str,
    x: Any,
    y: Any,
    spread: Any,
    **look: Any,
) -> None:
    """Points with error bars in the look of a model; `look` overrides it."""
    axes.errorbar(
        x,
        y,
        yerr=spread,
        **{"lw": 0.9, **look_of(model), **look},
    )


def error_bars(
    axes: Axes,
    model: str,
    x: Iterable[float],
    lines: Sequence[Row],
    floor: float,
    marker: bool = True,
) -> None:
    """Test errors of rows of runs with their intervals; no error is drawn at `floor`."""
    if not lines:
        return
    accuracy, lowest, highest = _accuracies(lines)
    error, low, high = 1 - accuracy, 1 - highest, 1 - lowest
    y = np.maximum(error, floor)
    spread = [y - np.maximum(low, floor), high - y]
    look: dict[str, Any] = {} if marker else {"marker": None}
    bars(
        axes,
        model,
        list(x),
        y,
        spread,
        elinewidth=0.7,
        capsize=1.5,
        zorder=3,
        **look,
    )


def _accuracies(lines: Sequence[Row]) -> NDArray[np.float64]:
    """Test accuracies and their bounds, [3, n]."""
    names = [f"test_accuracy_final{end}" for end in ("", "_low", "_high")]
    columns = [list(map(itemgetter(name), lines)) for name in names]
    return np.array(columns, float)


def published_point(
    axes: Axes,
    model: str,
    x: float,
    y: float,
    size: float,
) -> None:
    """The paper's value of a model, a star in its colour."""
    axes.plot(
        x,
        y,
        "*",
        color=style_of(model)[0],
        ms=size,
        mec="black",
        mew=0.6,
        zorder=5,
        clip_on=False,
    )


def error_axis(axes: Axes, rows: Sequence[Row]) -> float:
    """A logarithmic axis of errors in percent, with a strip for no error at all; where that is."""
    # Half an error among all the test samples that a row pools.
    counts = [line["n_test"] for line in rows if line["seeds"]]
    n_test = max(counts, default=100)
    floor = 0.5 / n_test
    axes.set_yscale("log")
    axes.set_ylim(floor * 0.8, 1.1)
    decades = (0.001, 0.01, 0.1)
    ticks = [tick * k for tick in decades for k in (1, 2, 5)]
    above = [tick for tick in ticks if tick >= 0.99 / n_test]
    axes.yaxis.set_major_locator(FixedLocator([floor, *above, 1.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda y, _: "0" if y < 0.9 / n_test else f"{100 * y:g} %")
    )
    axes.axhspan(
        floor * 0.8,
        0.72 / n_test,
        color="0.92",
        lw=0,
        zorder=0,
    )
    return floor


def plain_decades(axes: Axes) -> None:
    """Decades of the x axis written out where they are short."""
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda x, _: f"{x:,g}" if 1e-3 <= x <= 1e5 else f"{x:.0e}")
    )


def accuracy_curves(
    axes: Axes,
    rows: Sequence[Row],
    models: Sequence[str],
    key: str,
    also: Iterable[float] = (),
) -> None:
    """Accuracy in percent over a logarithmic axis; models are set apart by a few percent of x.

    The axis spans what the rows ask for, measured or not, and the places in `also`.
    """
    axes.set_xscale("log")
    asked_for = [line[key] for line in rows if line[key]]
    places = [*also, *asked_for]
    if places:
        axes.set_xlim(min(places) / 1.35, max(places) * 1.35)
    measured = [line for line in rows if line["seeds"]]
    lows = [line["test_accuracy_final_low"] for line in measured]
    lowest = 100 * min(lows, default=1.0)
    for k, model in enumerate(models):
        lines = [line for line in measured if line["model"] == model]
        if not lines:
            continue
        lines.sort(key=itemgetter(key))
        apart = 1.02 ** (k - len(models) // 2)
        x = [line[key] * apart for line in lines]
        y, low, high = 100 * _accuracies(lines)
        look = {"elinewidth": 0.6, "capsize": 1.2}
        bars(axes, model, x, y, [y - low, high - y], **look)
    axes.set_ylim(min(15, lowest - 2), 102)
    axes.set_ylabel("test accuracy (%)")
