"""How figures look: one column wide (3.4 in), the same file every time.

Matplotlib takes longer to load than a table to make: it is imported where something is drawn.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.records import configs
from experiments.records.console import printable
from experiments.reporting.columns import display_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

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
_LINE = 60 / 3.4  # characters of a head's line, an inch


def save(figure: Figure) -> bytes:
    """The figure as SVG, free of dates and random names."""
    from matplotlib import rc_context

    stream = io.BytesIO()
    with rc_context(fname=STYLE):
        figure.savefig(stream, format="svg", dpi=150, metadata={"Date": None})
    # A hundredth of a point is finer than any screen; the page carries every figure. Only what
    # stands within tags is shortened: numbers between them are text.
    return re.sub(
        rb"<[^>]*>",
        lambda tag: re.sub(rb"(\d\.\d\d)\d+", rb"\1", tag[0]),
        stream.getvalue(),
    )


def look_of(model: str) -> dict[str, Any]:
    """Arguments of ``plot`` for a model, the same in every figure, as its config has them; markers
    of a dashed line are empty: alone they differ."""
    shown = configs.display(model.partition(" (")[0])
    colour, line = shown["colour"], shown["line"]
    fill = "white" if line == "--" else colour
    return {"color": colour, "marker": shown["marker"], "ls": line, "mfc": fill}


def entry(label: str, **look: Any) -> Line2D:
    """An entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **look)


def handle(model: str, width: int = 100, **look: Any) -> Line2D:
    """The legend's entry of a model; its name in lines of so many characters."""
    return entry(wrapped(display_name(model), width), **(look or look_of(model)))


def published_look(model: str) -> dict[str, Any]:
    """How the paper's value of a model is drawn, in its colour."""
    return {**PAPER, "mfc": look_of(model)["color"]}


def head(figure: Figure, title: str, details: str = "") -> None:
    """A title and, below it, what it is of; wrapped to the width of the figure."""
    width = round(_LINE * figure.get_figwidth())
    lines = [line for text in (title, details) for line in textwrap.wrap(text, width)]
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=7)


def literal(text: str) -> str:
    """A name of the user's, in which matplotlib must not look for mathematics."""
    return printable(text).replace("$", r"\$")


def wrapped(text: str, width: int) -> str:
    """A name of the user's in lines of so many characters."""
    return "\n".join(map(literal, textwrap.wrap(text, width)))


def panel(axes: Axes, letter: str, title: str) -> None:
    """``(a) title`` above the axes, from their left; a title of several lines is ragged right."""
    axes.set_title(f"({letter}) {title}", loc="left", fontsize=6.5, pad=3)


def legend_below(figure: Figure, handles: Iterable[Any], columns: int = 2) -> None:
    """One legend below all panels."""
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)


def plain_decades(axes: Axes) -> None:
    """Decades of the x axis written out where they are short."""
    axes.xaxis.set_major_formatter(
        lambda x, _: f"{x:,g}" if 1e-3 <= x <= 1e5 else f"{x:.0e}"
    )
    axes.xaxis.set_minor_formatter(lambda *_: "")  # they overlap within one decade
