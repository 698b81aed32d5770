"""Square matrices in colour: correlations and confusions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import PowerNorm
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from experiments.reporting.plot import literal

# Light to dark in any colour vision, and in grey.
CORRELATION_MAP, CONFUSION_MAP = "cividis", "Blues"
# Classes up to which every one is named, and its cells have room for numbers.
PRINTED = 12


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
        for cell, text in np.ndenumerate(np.array(cells, object)):
            _write(axes, image, values, cell, text)
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
    cell: tuple[int, ...],
    text: str,
) -> None:
    """A text in a cell of a matrix, black on light colours and white on dark ones."""
    row, column = cell
    red_green_blue = image.to_rgba(values[cell])[:3]
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
