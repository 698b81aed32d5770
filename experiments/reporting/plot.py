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

from experiments.records import configs
from experiments.records.rows import Row
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.text import frames_of, printable

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


def handle(model: str) -> Line2D:
    """The legend's entry of a model."""
    return Line2D(
        [],
        [],
        label=literal(display_name(model)),
        **look_of(model),
    )


def by_panel(models: Sequence[str]) -> list[Sequence[str]]:
    """Models in groups, one per panel, as many in each as its legend may name."""
    places = range(0, len(models), _MOST_ENTRIES)
    return [models[k : k + _MOST_ENTRIES] for k in places]


def star(label: str) -> Line2D:
    """The legend's entry of the paper's values."""
    return Line2D([], [], label=label, **PAPER)


def head(
    figure: Figure,
    title: str,
    details: Iterable[str],
) -> None:
    """A title and, below it, what it is of; wrapped to the width of the figure."""
    lines = []
    width, _ = figure.get_size_inches()
    for text in (title, *details):
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


def title(
    figure: Figure,
    axes: Axes,
    text: str,
    rows: Sequence[Row],
    split: str = "",
) -> None:
    """Title with the scene of rows of runs, the origin of its frames, and their split."""
    seeds = sorted({line["seeds"] for line in rows if line["seeds"]})
    details = []
    if seeds:
        ends = dict.fromkeys((seeds[0], seeds[-1]))
        count = "–".join(map(str, ends))
        count += " seed" if seeds[-1] == 1 else " seeds"
        strip = ", grey: no error" if axes.get_yscale() == "log" else ""
        scenes = ", ".join(dict.fromkeys(scene_name(line["scene"]) for line in rows))
        frames = ", ".join(filter(None, [literal(scenes), frames_of(rows), split]))
        details.append(f"{frames}, {count}, 95 % intervals{strip}")
    head(figure, text, details)


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
