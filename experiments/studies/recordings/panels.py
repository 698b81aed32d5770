"""A panel a recording, as the figures of this study have them."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

WIDTH = 7.0  # in, two columns of a journal


def grid(
    figure: Figure,
    count: int,
    row: float,
    rest: float,
    most: int = 4,
    sharey: bool = False,
) -> tuple[list[Axes], list[Axes]]:
    """Panels for so many recordings; the figure gets the height that they need.

    Args:
        figure: takes the panels.
        count: of recordings.
        row: height of a row of panels, in.
        rest: height of what stands around them, in.
        most: panels in a row.
        sharey: whether all share one axis.

    Returns:
        The panels, and those of them that stand at the left.
    """
    down = math.ceil(count / most)
    across = math.ceil(count / down)  # rows as even as they can be
    figure.set_size_inches(WIDTH, rest + row * down)
    panels = figure.subplots(down, across, sharey=sharey, squeeze=False).ravel()
    for unused in panels[count:]:
        unused.set_visible(False)
    return list(panels[:count]), list(panels[::across])
