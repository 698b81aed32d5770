"""What the paper's figures have in common: a head that says what a reader has to know, panels."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from experiments.measurement import Measured
from experiments.paper_data import Estimate
from experiments.selection import Group
from experiments.sources import outdated

# Light to dark in any colour vision, and in grey.
CORRELATION_MAP, CONFUSION_MAP = "cividis", "Blues"
PAPER: dict[str, Any] = {
    "ls": "",
    "marker": "*",
    "mfc": "white",
    "mec": "black",
    "ms": 7,
    "mew": 0.7,
}
PRINTED = 12  # classes up to which every one is named, and its cells have room for numbers
_LINE = 66  # characters of a head's line


def head(figure: Figure, title: str, details: Iterable[str]) -> None:
    """A title and, below it, what it is of; wrapped to the width of a column."""
    lines = [title]
    for detail in details:
        lines += textwrap.wrap(detail, _LINE)
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=7)


def seeds_of(n: int) -> str:
    """``5 seeds``."""
    return f"{n} seed{'s' * (n != 1)}"


def changed(*made: Group | Measured) -> list[str]:
    """A line that says so if code has changed since one of these was made."""
    files = set()
    for one in made:
        if isinstance(one, Group):
            for run in one.runs:
                files |= set(outdated(run.record["environment"]["sources"]))
        else:
            files |= set(one.outdated)
    return [f"code changed since: {', '.join(sorted(files))}"] if files else []


def panel(axes: Axes, letter: str, title: str) -> None:
    """``(a) title`` above the axes, from their left."""
    axes.set_title(f"({letter}) {title}", loc="left", fontsize=6.5, pad=3)


def matrix(
    axes: Axes,
    values: NDArray[np.float64],
    names: Sequence[str],
    cells: Sequence[Sequence[str]] | None = None,
    colours: str = CORRELATION_MAP,
    limits: tuple[float | None, float | None] = (None, None),
    gamma: float = 1.0,
    label: str = "",
) -> Colorbar:
    """A square matrix in colour, with a bar of it (returned); `cells` are written into it.

    Args:
        axes: where.
        values: [L, L]; rows from top to bottom.
        names: of rows and columns.
        cells: texts [L][L].
        colours: a map.
        limits: ends of the colour scale.
        gamma: colour goes as value**gamma: below 1 small values are told apart.
        label: of the bar, with its unit.
    """
    axes.spines[:].set(visible=True, color="0.7", linewidth=0.4)
    norm = PowerNorm(gamma, *limits)
    image = axes.imshow(values, cmap=colours, norm=norm, interpolation="nearest")
    step = 1 if len(names) <= PRINTED else 10
    ticks = range(0, len(names), step)
    axes.set_xticks(ticks, [names[i] for i in ticks], fontsize=6)
    axes.set_yticks(ticks, [names[i] for i in ticks], fontsize=6)
    axes.tick_params(length=0 if step == 1 else 2, pad=2)
    for (i, j), text in np.ndenumerate(np.array(cells, object)) if cells else ():
        light = np.dot(image.to_rgba(values[i, j])[:3], (0.3, 0.6, 0.1)) > 0.5
        axes.text(j, i, text, ha="center", va="center", fontsize=5.5,
                  color="black" if light else "white")  # fmt: skip
    place, aspect = ("right", 20) if step == 1 else ("bottom", 25)
    bar = axes.figure.colorbar(  # type: ignore[union-attr]
        image, ax=axes, location=place, fraction=0.05, pad=0.03, aspect=aspect
    )
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(labelsize=5.5, length=2, pad=1)
    bar.set_label(label, fontsize=6, labelpad=2)
    return bar


def errors(found: Sequence[Estimate], scale: float = 1.0) -> tuple[NDArray, NDArray]:
    """Values, and distances of the bounds from them [2, n] for ``errorbar``; zero if unknown."""
    value, low, high = scale * np.array(found, float).reshape(-1, 3).T
    return value, np.nan_to_num(np.array([value - low, high - value]))


def star(label: str) -> Line2D:
    """The legend's entry of the paper's values."""
    return Line2D([], [], label=label, **PAPER)
