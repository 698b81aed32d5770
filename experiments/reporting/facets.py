"""Two ways to draw a table: lines with intervals in panels, and intervals side by side.

The table is tidy: it has a column ``y`` with its bounds ``y_low`` and ``y_high``, and the columns
that name the panel and the line of each row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.reporting.plot import literal, look_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

Look = Callable[[Any], Mapping[str, Any]]
# Classes of a matrix up to which every one is named, and its cells have room for numbers.
PRINTED = 12


def spread(
    data: pd.DataFrame, y: str, scale: float = 1.0
) -> tuple[NDArray, NDArray | None]:
    """Values [n], and distances of the bounds from them [2, n]: zero where a bound is not known,
    or lies on the other side of its value; None where none is known."""
    values = scale * data[y].to_numpy(float)
    names = [f"{y}_low", f"{y}_high"]
    if not set(names) <= set(data) or data[names].isna().all(axis=None):
        return values, None
    low, high = scale * data[names].to_numpy(float).T
    distances = np.array([values - low, high - values])
    return values, np.maximum(np.nan_to_num(distances), 0)


def line(
    axes: Axes, data: pd.DataFrame, x: str, y: str, scale: float = 1.0, **look: Any
) -> None:
    """A column over another, with its intervals."""
    values, distances = spread(data, y, scale)
    shown = {"lw": 0.9, "elinewidth": 0.6, "capsize": 1.2, **look}
    axes.errorbar(data[x].to_numpy(float), values, yerr=distances, **shown)


def facets(
    figure: Figure,
    data: pd.DataFrame,
    x: str,
    y: str,
    hue: str,
    row: str,
    column: str,
    scale: float = 1.0,
    **shared: Any,
) -> dict[tuple[Any, Any], Axes]:
    """Panels in a grid, in each a line per value of `hue`; the panels by row and column.

    Args:
        figure: drawn on.
        data: the table.
        x, y: columns of the axes.
        hue, row, column: columns that tell lines, which are models, and rows and columns of panels
            apart.
        scale: of `y`; 100 shows a share in percent.
        shared: of ``Figure.subplots``, such as ``sharex``.
    """
    down, across = data[row].unique(), data[column].unique()
    grid = figure.subplots(len(down), len(across), squeeze=False, **shared)
    panels = {}
    for axes_of_row, of_row in zip(grid, down, strict=True):
        for axes, of_column in zip(axes_of_row, across, strict=True):
            here = data[(data[row] == of_row) & (data[column] == of_column)]
            for of_hue, points in here.groupby(hue, sort=False):
                line(axes, points, x, y, scale, **look_of(str(of_hue)))
            panels[of_row, of_column] = axes
    return panels


def intervals(
    axes: Axes,
    data: pd.DataFrame,
    value: str,
    by: str,
    hue: str,
    *,
    names: Sequence[Any],
    hues: Sequence[Any],
    look: Look,
    scale: float = 1.0,
    apart: float = 0.3,
) -> None:
    """Points with their intervals, a place per value of `by` from top to bottom, and there one
    below the other per value of `hue`.

    Args:
        axes: drawn on.
        data: the table.
        value: its column.
        by, hue: columns that tell places, and points at one place, apart.
        names: values of `by`, from the first place on.
        hues: values of `hue`, in the order in which they stand at a place.
        look: arguments of ``errorbar`` for a value of `hue`.
        scale: of the value.
        apart: distance between the first and the last of one place.
    """
    step = apart / max(1, len(hues) - 1)
    for k, of_hue in enumerate(hues):
        points = data[data[hue] == of_hue]
        places = points[by].map(list(names).index).astype(float)
        at = places + step * (k - (len(hues) - 1) / 2)
        values, distances = spread(points, value, scale)
        shown = {"ls": "", "zorder": 3, **look(of_hue)}
        axes.errorbar(values, at, xerr=distances, **shown)


def matrix(
    axes: Axes,
    values: pd.DataFrame,
    cell: Callable[[float], str],
    colours: str = "cividis",
    limits: tuple[float | None, float | None] = (None, None),
    gamma: float = 1.0,
) -> Colorbar:
    """A square matrix in colour, with a bar of it (returned).

    Args:
        axes: drawn on.
        values: rows from top to bottom; index and columns are the names of classes.
        cell: the text of a value, where there is room for it.
        colours: a map, from the one to the other of `limits`.
        gamma: colour goes as value**gamma: below 1 small values can be distinguished.
    """
    from matplotlib.colors import PowerNorm

    axes.spines[:].set(visible=True, color="0.7", linewidth=0.4)
    norm = PowerNorm(gamma, *limits)
    image = axes.imshow(values, cmap=colours, norm=norm, interpolation="nearest")
    few = len(values) <= PRINTED
    ticks = range(0, len(values), 1 if few else 10)
    names = [literal(str(values.columns[k])) for k in ticks]
    upright = few and max(map(len, names)) > 5  # side by side, long names overlap
    axes.set_xticks(ticks, names, fontsize=6, rotation=90 if upright else 0)
    axes.set_yticks(ticks, names, fontsize=6)
    axes.tick_params(length=0 if few else 2, pad=2)
    if few:
        for (row, column), value in np.ndenumerate(values.to_numpy(float)):
            light = np.dot(image.to_rgba(value)[:3], (0.3, 0.6, 0.1)) > 0.5
            look: Any = {"ha": "center", "va": "center", "fontsize": 5.5}
            colour = "black" if light else "white"
            axes.text(column, row, cell(value), color=colour, **look)
    where, aspect = ("right", 20) if few else ("bottom", 25)
    place: Any = {"location": where, "fraction": 0.05, "pad": 0.03, "aspect": aspect}
    bar = axes.figure.colorbar(image, ax=axes, **place)
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(labelsize=5.5, length=2, pad=1)
    return bar
