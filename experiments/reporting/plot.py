"""How figures look: one column wide (3.4 in), the same file every time.

An accuracy on n test samples cannot tell an error below 1/n from none: errors of zero are drawn in
a grey strip of their own below 1/n, labelled 0. Intervals are those of the tables.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from experiments.records import configs
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.rows import Row
from experiments.reporting.text import frames_of, printable

plt.switch_backend("Agg")  # without a display
STYLE = Path(__file__).with_name("column.mplstyle")
# Light to dark in any colour vision, and in grey.
CORRELATION_MAP, CONFUSION_MAP = "cividis", "Blues"
PAPER: Any = {
    "ls": "",
    "marker": "*",
    "mfc": "white",
    "mec": "black",
    "ms": 7,
    "mew": 0.7,
}
PRINTED = (
    12  # classes up to which every one is named, and its cells have room for numbers
)
LETTERS = "abcdefghijklmnopqrstuvwxyz"  # of panels
_LINE = 60  # characters of a head's line


def save(figure: Figure, kind: str) -> bytes:
    """The figure as ``svg``, ``png`` or ``webp``, free of dates and random names; it is closed."""
    with plt.rc_context(fname=STYLE):
        stream = io.BytesIO()
        options: dict[str, Any] = {"metadata": {"Date": None}} if kind == "svg" else {}
        if kind == "webp":  # speckle does not compress; this is what a page can carry
            options = {"pil_kwargs": {"quality": 40}}
        figure.savefig(stream, format=kind, dpi=150, **options)
    plt.close(figure)
    if kind != "svg":
        return stream.getvalue()
    # A hundredth of a point is finer than any screen; the page carries every figure. Only what
    # stands within tags is shortened: numbers between them are text.
    return re.sub(
        rb"<[^>]*>",
        lambda tag: re.sub(rb"(\d\.\d\d)\d+", rb"\1", tag[0]),
        stream.getvalue(),
    )


def style_of(model: str) -> tuple[str, str, str]:
    """Colour, marker and line of a model, the same in every figure, as its config has them."""
    shown = configs.display(model.partition(" (")[0])
    return shown["colour"], shown["marker"], shown["line"]


def look_of(model: str) -> dict[str, Any]:
    """Arguments of ``plot`` for a model; markers of a dashed line are empty: alone they differ."""
    colour, marker, line = style_of(model)
    fill = "white" if line == "--" else colour
    return {
        "color": colour,
        "marker": marker,
        "ls": line,
        "mfc": fill,
    }


def handle(model: str) -> Line2D:
    """The legend's entry of a model."""
    return Line2D(
        [],
        [],
        label=literal(display_name(model)),
        **look_of(model),
    )


def star(label: str) -> Line2D:
    """The legend's entry of the paper's values."""
    return Line2D([], [], label=label, **PAPER)


def head(
    figure: Figure,
    title: str,
    details: Iterable[str],
) -> None:
    """A title and, below it, what it is of; wrapped to the width of a column."""
    lines = []
    for text in (title, *details):
        lines += textwrap.wrap(text, _LINE)
    figure.suptitle(
        "\n".join(lines),
        x=0.01,
        ha="left",
        fontsize=7,
    )


def literal(text: str) -> str:
    """A name of the user's, in which matplotlib must not look for mathematics."""
    return printable(text).replace("$", r"\$")


def title(
    figure: Figure,
    axes: Axes,
    text: str,
    rows: Sequence[Row],
    shown: Sequence[str],
    wanted: Sequence[str],
    handles: Sequence[Line2D] = (),
) -> None:
    """Title with the origin of the frames and what has no record; a legend below the axes."""
    seeds = sorted({line["seeds"] for line in rows if line["seeds"]})
    details = []
    if seeds:
        ends = dict.fromkeys((seeds[0], seeds[-1]))
        count = "–".join(map(str, ends))
        count += " seed" if seeds[-1] == 1 else " seeds"
        strip = ", grey: no error" if axes.get_yscale() == "log" else ""
        details.append(f"{frames_of(rows)}, {count}, 95 % intervals{strip}")
    # Lines break between names, not within one.
    missing = [model for model in dict.fromkeys(wanted) if model not in shown]
    if missing:
        called = [literal(display_name(model)) for model in missing]
        names = "; ".join(name.replace(" ", "\xa0") for name in called)
        details.append(f"no records: {names}")
    head(figure, text, details)
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    figure.set_layout_engine("constrained")


def wrapped(text: str, width: int) -> str:
    """A name of the user's in lines of so many characters."""
    return "\n".join(map(literal, textwrap.wrap(text, width)))


def panel(
    axes: Axes,
    letter: str,
    title: str,
) -> None:
    """``(a) title`` above the axes, from their left; a title of several lines is ragged right."""
    axes.set_title(
        f"({letter}) {title}",
        loc="left",
        fontsize=6.5,
        pad=3,
    )


def matrix(
    axes: Axes,
    values: NDArray[np.float64],
    names: Sequence[str],
    cells: Sequence[Sequence[str]] | None = None,
    colours: str = CORRELATION_MAP,
    limits: tuple[float | None, float | None] = (None, None),
    gamma: float = 1.0,
) -> Colorbar:
    """A square matrix [L, L] in colour, with a bar of it (returned).

    Args:
        axes: where.
        values: rows from top to bottom.
        names: of rows and columns.
        cells: texts [L][L] that are written into it.
        colours: a map, from the one to the other of `limits`.
        gamma: colour goes as value**gamma: below 1 small values are told apart.
    """
    axes.spines[:].set(visible=True, color="0.7", linewidth=0.4)
    norm = PowerNorm(gamma, *limits)
    image = axes.imshow(
        values,
        cmap=colours,
        norm=norm,
        interpolation="nearest",
    )
    step = 1 if len(names) <= PRINTED else 10
    ticks = range(0, len(names), step)
    shown = [literal(names[i]) for i in ticks]
    upright = step == 1 and max(map(len, shown)) > 5  # side by side, long names overlap
    axes.set_xticks(
        ticks,
        shown,
        fontsize=6,
        rotation=90 if upright else 0,
    )
    axes.set_yticks(ticks, shown, fontsize=6)
    axes.tick_params(length=0 if step == 1 else 2, pad=2)
    if cells:
        for place, text in np.ndenumerate(np.array(cells, object)):
            _write(axes, image, values, place, text)
    where, aspect = ("right", 20) if step == 1 else ("bottom", 25)
    bar = axes.figure.colorbar(  # type: ignore[union-attr]
        image,
        ax=axes,
        location=where,
        fraction=0.05,
        pad=0.03,
        aspect=aspect,
    )
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(labelsize=5.5, length=2, pad=1)
    return bar


def _write(
    axes: Axes,
    image: AxesImage,
    values: NDArray[np.float64],
    place: tuple[int, ...],
    text: str,
) -> None:
    """A text in a cell of a matrix, black on light colours and white on dark ones."""
    row, column = place
    red_green_blue = image.to_rgba(values[place])[:3]
    light = np.dot(red_green_blue, (0.3, 0.6, 0.1)) > 0.5
    axes.text(
        column,
        row,
        text,
        ha="center",
        va="center",
        fontsize=5.5,
        color="black" if light else "white",
    )


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


def line_plot(
    axes: Axes,
    frame: pd.DataFrame,
    x: str,
    y: str,
    by: str = "model",
    looks: Mapping[str, Mapping[str, Any]] | None = None,
    **style: Any,
) -> list[Line2D]:
    """Mean of `y` over seeds against `x`, a line a value of `by`, with Student's 95 % bars; returns
    entries for a legend.

    Args:
        axes: where.
        frame: a row a point of one seed; rows of one seed and x are averaged first.
        x, y, by: names of its columns; `by` holds models, or names in `looks`.
        looks: arguments of ``errorbar`` for values of `by` that are no models.
        style: the same for all.
    """
    handles = []
    for name, rows in frame.groupby(by, sort=False):
        means = rows.groupby([x, "seed"])[y].mean().groupby(level=0)
        places = np.array(list(means.groups), float)
        intervals = [mean_interval(list(values)) for _, values in means]
        value, spread = errors(intervals)
        look = dict((looks or {}).get(str(name), {}))
        if not look:
            label = literal(display_name(str(name)))
            look = {**look_of(str(name)), "label": label}
        axes.errorbar(
            places,
            value,
            yerr=spread,
            elinewidth=0.5,
            **{
                "lw": 0.9,
                **look,
                **style,
            },
        )
        shown = {
            key: look[key]
            for key in look
            if key in ("color", "marker", "ls", "mfc", "label")
        }
        handles.append(Line2D([], [], **shown))
    return handles


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
    alpha: float = 1.0,
) -> None:
    """Accuracy in percent over a logarithmic axis; models are set apart by a few percent of x.

    The axis spans what the rows ask for, measured or not, and the places in `also`; `alpha` below 1
    makes the curves pale.
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
        look = {"elinewidth": 0.6, "capsize": 1.2, "alpha": alpha}
        bars(axes, model, x, y, [y - low, high - y], **look)
    axes.set_ylim(min(15, lowest - 2), 102)
    axes.set_ylabel("test accuracy (%)")
