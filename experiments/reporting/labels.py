"""Names beside points of a figure, where no name covers another one or a point."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from experiments.reporting.plot import literal

_SIZE = 5  # of the letters, in points
_POINT = 2.5  # half the edge of a marker, in points
_DISTANCES = (4, 9, 15, 22, 30, 40)  # of a name from its point, in points
_DIRECTIONS = ((1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1))
_JOINED = 4  # points, beyond which a line joins a name with its point


def name_points(axes: Axes, points: ArrayLike, names: Mapping[int, str]) -> None:
    """Write a name beside some points, the nearest place that is free.

    The figure has to have its final layout (``Figure.draw_without_rendering``).

    Args:
        axes: where the points are.
        points: all points that a name must not cover, [n, 2] in units of the axes.
        names: by the row of the point.
    """
    figure: Any = axes.figure
    unit = figure.dpi / 72  # pixels per point
    places = axes.transData.transform(np.asarray(points, float))
    edge = _POINT * unit
    taken = [
        Bbox.from_extents(x - edge, y - edge, x + edge, y + edge) for x, y in places
    ]
    frame = axes.get_window_extent()
    for row, name in names.items():
        found = None
        for distance, direction, box in _candidates(axes, places[row], name, unit):
            inside = frame.x0 <= box.x0 <= box.x1 <= frame.x1
            inside &= frame.y0 <= box.y0 <= box.y1 <= frame.y1
            if inside and not box.count_overlaps(taken):
                found = distance, direction, box
                break
        if found is None:  # crowded: beside the point, over others
            found = next(_candidates(axes, places[row], name, unit))
        taken.append(found[-1].padded(unit / 2))
        _write(axes, np.asarray(points, float)[row], name, *found)


def _candidates(
    axes: Axes, place: np.ndarray, name: str, unit: float
) -> Iterator[tuple[int, tuple[int, int], Bbox]]:
    """Distance and direction from a point, and what the name would cover there, the nearest
    first."""
    text = axes.text(0, 0, literal(name), fontsize=_SIZE)
    size = text.get_window_extent()
    text.remove()
    for distance, (right, up) in itertools.product(_DISTANCES, _DIRECTIONS):
        x = place[0] + right * distance * unit - (1 - right) / 2 * size.width
        y = place[1] + up * distance * unit - (1 - up) / 2 * size.height
        yield distance, (right, up), Bbox.from_bounds(x, y, size.width, size.height)


def _write(
    axes: Axes,
    point: np.ndarray,
    name: str,
    distance: int,
    direction: tuple[int, int],
    box: Bbox,
) -> None:
    line: Any = None
    if distance > _JOINED:
        nearest = [(1 - part) / 2 for part in direction]  # corner or middle of an edge
        line = {"arrowstyle": "-", "lw": 0.4, "color": "0.5", "shrinkA": 0}
        line |= {"shrinkB": _POINT, "relpos": nearest}
    corner = axes.transAxes.inverted().transform((box.x0, box.y0))
    text = axes.annotate(
        literal(name),
        tuple(point),
        tuple(corner),
        textcoords="axes fraction",
        fontsize=_SIZE,
        ha="left",
        va="bottom",
        arrowprops=line,
        # No line of the figure runs through a name.
        bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none"},
    )
    text.set_in_layout(False)
