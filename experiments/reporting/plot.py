"""How figures look: one column wide (3.4 in), the same file every time."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from experiments.records import configs
from experiments.reporting.columns import display_name
from experiments.reporting.text import printable

plt.switch_backend("Agg")  # without a display
STYLE = Path(__file__).with_name("column.mplstyle")
PAPER: Any = {
    "ls": "",
    "marker": "*",
    "mfc": "white",
    "mec": "black",
    "ms": 7,
    "mew": 0.7,
}
DASHED: Any = {"color": "0.5", "lw": 0.8, "ls": (0, (4, 3)), "zorder": 0}
LETTERS = "abcdefghijklmnopqrstuvwxyz"  # of panels
_MOST_ENTRIES = 4  # of the legend of a panel
_LINE = 60 / 3.4  # characters of a head's line, an inch


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


def handle(model: str, width: int = 0) -> Line2D:
    """The legend's entry of a model; its name in lines of so many characters."""
    name = display_name(model)
    label = wrapped(name, width) if width else literal(name)
    return Line2D([], [], label=label, **look_of(model))


def by_panel(models: Sequence[str]) -> list[Sequence[str]]:
    """Models in groups, one per panel, as many in each as its legend may name."""
    places = range(0, len(models), _MOST_ENTRIES)
    return [models[k : k + _MOST_ENTRIES] for k in places]


def published_point(axes: Axes, model: str, x: float, y: float, size: float) -> None:
    """The paper's value of a model, a star in its colour."""
    colour, _, _ = style_of(model)
    look: Any = {**PAPER, "mfc": colour, "ms": size, "mew": 0.6}
    axes.plot(x, y, zorder=5, clip_on=False, **look)


def head(figure: Figure, title: str, details: str = "") -> None:
    """A title and, below it, what it is of; wrapped to the width of the figure."""
    lines = []
    width, _ = figure.get_size_inches()
    for text in filter(None, (title, details)):
        lines += textwrap.wrap(text, round(_LINE * width))
    figure.suptitle(
        "\n".join(lines),
        x=0.01,
        ha="left",
        fontsize=7,
    )


def literal(text: str) -> str:
    """A name of the user's, in which matplotlib must not look for mathematics."""
    return printable(text).replace("$", r"\$")


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


def legend_below(figure: Figure, handles: Iterable[Any], columns: int = 2) -> None:
    """One legend below all panels."""
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)


def plain_decades(axes: Axes) -> None:
    """Decades of the x axis written out where they are short."""
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda x, _: f"{x:,g}" if 1e-3 <= x <= 1e5 else f"{x:.0e}")
    )
